"""The protocol of virtual offsets: cases, estimators, outcomes, plots."""
