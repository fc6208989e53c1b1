"""Windows and days without a move: what the change search and the alarm chart make of them."""
