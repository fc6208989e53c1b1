"""Offline runs of what the service would serve: windows, batches, outcomes, long replays."""
