"""Regressors trained for many cases: their calibration, and the weights that they start from."""
