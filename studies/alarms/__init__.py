"""Studies of alarms: false ones, and delays, on recorded scenes and simulated years."""
