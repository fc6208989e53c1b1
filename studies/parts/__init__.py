"""What each part of the estimator is worth: the protocol with one part off at a time."""
