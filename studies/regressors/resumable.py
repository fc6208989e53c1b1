"""A training that is ended and goes on: its weights, its optimizer and how far it was."""

from pathlib import Path
from pickle import UnpicklingError
from typing import Any

import torch
from torch import nn

from models.errors import CheckpointError


def save_training(
    path: Path, network: nn.Module, optimizer: torch.optim.Optimizer, so_far: dict[str, float]
) -> None:
    """Write what a later process needs to go on, whole or not at all."""
    partial = path.with_suffix(".partial")
    state = {"network": network.state_dict(), "optimizer": optimizer.state_dict(), **so_far}
    torch.save(state, partial)
    partial.replace(path)


def resume_training(
    path: Path, network: nn.Module, optimizer: torch.optim.Optimizer
) -> dict[str, Any]:
    """Take over what `save_training` wrote of the same network; returns how far it was.

    Raises:
        CheckpointError: the file is damaged or of another network.
    """
    try:
        state: dict[str, Any] = torch.load(path, weights_only=True)
        network.load_state_dict(state.pop("network"))
        optimizer.load_state_dict(state.pop("optimizer"))
    except (OSError, RuntimeError, KeyError, ValueError, UnpicklingError) as error:
        raise CheckpointError(f"{path}: no training to go on with: {error}") from error
    return state
