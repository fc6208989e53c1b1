"""Studies of path density maps and of heads, on simulated sites."""
