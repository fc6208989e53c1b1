"""Study of each part of the estimator: the protocol with one part off at a time."""
