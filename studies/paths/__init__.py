"""Studies of simulated sites, and the paper's own experiment."""
