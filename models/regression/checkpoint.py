"""Weights as files: those of cameras by their hash, and those that trainings start from."""

import hashlib
import os
from pathlib import Path

import torch
from safetensors import SafetensorError
from safetensors.torch import load, save

from models.errors import CheckpointError
from models.regression.network import PoseRegressor, network_for
from models.regression.recipe import Recipe, weights_path
from models.serialization import Format, from_bytes

START = Path(__file__).parent / "start.safetensors.gz"
START_FORMAT = Format(name="regressor_start", version=1)


def save_weights(network: PoseRegressor, folder: Path) -> str:
    """Write the weights, whole or not at all; returns the SHA-256 that names the file."""
    data = save({name: tensor.contiguous() for name, tensor in network.state_dict().items()})
    digest = hashlib.sha256(data).hexdigest()
    folder.mkdir(parents=True, exist_ok=True)
    path = weights_path(folder, digest)
    partial = path.with_suffix(f".{os.getpid()}.partial")
    with partial.open("wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    partial.replace(path)
    return digest


def load_weights(folder: Path, digest: str, recipe: Recipe) -> PoseRegressor:
    """The network of a weights file, ready to predict.

    Raises:
        CheckpointError: the file is missing, damaged or of another network.
    """
    path = weights_path(folder, digest)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise CheckpointError(f"weights {digest}: {error}") from error
    found = hashlib.sha256(data).hexdigest()
    if found != digest:
        raise CheckpointError(f"weights {digest}: the file is damaged, its hash is {found}")
    network = network_for(recipe)
    try:
        network.load_state_dict(load(data))
    except (SafetensorError, RuntimeError) as error:
        raise CheckpointError(f"weights {digest}: not of recipe {recipe.name}: {error}") from error
    network.eval()
    return network


def starting_network(recipe: Recipe, path: Path = START) -> PoseRegressor:
    """The network that a training by a recipe begins with.

    Raises:
        CheckpointError: it starts from weights that are missing, damaged or of another network.
    """
    network = network_for(recipe)
    if recipe.start == "fresh":
        return network
    try:
        arrays = from_bytes(START_FORMAT, path.read_bytes())
        state = {name: torch.from_numpy(array).float() for name, array in arrays.items()}
        network.load_state_dict(state)
    except (OSError, RuntimeError, TypeError) as error:
        raise CheckpointError(f"starting weights: {error}") from error
    return network
