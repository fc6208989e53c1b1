"""Verticals: what people's heads above their feet tell of tilt and roll."""
