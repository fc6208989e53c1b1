"""Sending: which addresses may be reached, how a message is signed, what an attempt came to."""
