"""The periodic work: what should be under way, what may be forgotten."""
