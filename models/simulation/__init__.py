"""Synthetic pedestrians seen by cameras around a prior pose: seed in, trajectories out."""
