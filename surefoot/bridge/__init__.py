"""From what cameras and trackers send to whole tracks: adapters, and what assembles frames."""
