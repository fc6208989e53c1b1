"""The start, life and end of our processes."""
