"""The joint estimator: one pose for all tracks at once, no network."""
