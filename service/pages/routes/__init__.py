"""Routes of the operators' pages."""
