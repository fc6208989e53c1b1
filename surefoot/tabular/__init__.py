"""Tracks in text tables: one reader for `POST /cameras/{id}/tracks` and `surefoot.read_tracks`."""
