"""Tracks in, pose estimate out."""
