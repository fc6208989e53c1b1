"""Statements on tracks: which of them count, windows of them, predictions."""
