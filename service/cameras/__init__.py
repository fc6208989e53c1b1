"""Cameras, their state and served pose, and what people and trackers do to them."""
