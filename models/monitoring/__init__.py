"""Has the camera moved, and when."""
