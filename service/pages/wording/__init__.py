"""What pages say, in words."""
