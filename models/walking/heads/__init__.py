"""Tilt and roll by people's heads above their feet."""
