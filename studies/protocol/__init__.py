"""The protocol of virtual knocks: cases, estimators, outcomes, plots."""
