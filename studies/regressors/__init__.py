"""Regressors trained for many cases, and their calibration."""
