"""Making of the weights that every training begins with."""
