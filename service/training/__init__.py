"""Trainings of the regressors: queued, watched, published."""
