"""Offline runs of what the service would serve: windows, outcomes, long replays, parts off."""
