"""Loops over the rows of tracks, compiled: arrays and numbers in, arrays out.

All arrays are C-contiguous and writable, of float64, int64 or bool: of any other kind a function
would be compiled again.
"""
