"""Loops over the points of tracks, compiled."""
