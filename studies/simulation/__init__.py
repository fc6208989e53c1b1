"""Cameras, crowds and habits that studies alone draw."""
