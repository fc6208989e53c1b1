"""Statements on the service itself: access, activity, events, workers, the engine's jobs."""
