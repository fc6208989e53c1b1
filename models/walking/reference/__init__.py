"""What is usual at a site, learned from its first tracks, and the room that it needs to be told."""
