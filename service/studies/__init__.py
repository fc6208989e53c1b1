"""Studies in parallel: the protocol, alarms, the flow map, the paper's experiment."""
