"""Copies of a data directory: made while it is in use, checked, and put back."""
