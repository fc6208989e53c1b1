"""The regressor: network, recipes, training, checkpoints. The only rooms that import torch."""
