"""What pages, lists and metrics show of many things at once."""
