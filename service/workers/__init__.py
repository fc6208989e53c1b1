"""Background work: training, estimates, housekeeping, on a durable engine (DBOS)."""
