"""Weights that the training of a camera's regressor starts from, learned on many cameras."""
