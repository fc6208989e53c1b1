"""A camera's turn by two of its pictures, and what else a picture tells."""
