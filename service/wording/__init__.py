"""Words for people: reasons, states, alerts, moves, times, activity; out of values alone."""
