"""Calibration files that people have: one reader for HTTP, pages and Python."""
