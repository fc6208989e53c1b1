"""What the service would serve, offline: windows, batches, their outcomes, long replays."""
