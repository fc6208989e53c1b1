"""Estimates: what goes into them, learning and growing references, and what is stored."""
