"""What is done for each step, place or block of the flow map, as machine code, and its loops."""
