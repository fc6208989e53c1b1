"""Forms in which trackers hand over tracks."""
