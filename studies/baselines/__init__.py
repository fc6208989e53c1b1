"""Baselines of others, small and whole, to stand beside what is served. Nothing is served."""
