"""Doors: where walks begin and end inside the picture, as landmarks on the ground."""
