"""The map itself: cells and ways, and how a camera sees them."""
