"""Recorded scenes, and how far estimates on them are from the truth."""
