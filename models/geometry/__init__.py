"""The only sines and cosines of the project: rotations, poses, lenses, the ground plane."""
