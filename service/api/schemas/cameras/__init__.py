"""Bodies of cameras: their geometry, poses, tracks, and what is done to them."""
