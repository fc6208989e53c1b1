"""A robust linear mixed model of speeds, statures and heads, and its variance inflation."""
