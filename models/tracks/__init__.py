"""Tracks of pedestrians, and what is read of them: each walk once, whatever pieces it came in."""
