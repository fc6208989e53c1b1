"""What the command line starts, and what else it can be asked."""
