"""Drawings of pages: SVG out of geometry."""
