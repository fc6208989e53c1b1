"""The starting weights as they are shipped, and how they were made beside them."""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch

from models.errors import CheckpointError
from models.regression.network import PoseRegressor, network_for
from models.regression.recipe import Recipe
from models.serialization import Format, pack, unpack

SHIPPED = Path(__file__).parent / "start" / "start.safetensors.gz"
_FORMAT = Format(name="regressor_start", version=1)


def starting_network(recipe: Recipe, path: Path = SHIPPED) -> PoseRegressor:
    """The network that a training by a recipe begins with.

    Raises:
        CheckpointError: it starts from weights that are missing, damaged or of another network.
    """
    network = network_for(recipe)
    if recipe.start == "fresh":
        return network
    try:
        arrays = unpack(_FORMAT, path.read_bytes())
        state = {name: torch.from_numpy(array).float() for name, array in arrays.items()}
        network.load_state_dict(state)
    except (OSError, RuntimeError, TypeError) as error:
        raise CheckpointError(f"starting weights: {error}") from error
    return network


def store_start(network: PoseRegressor, path: Path, making: Mapping[str, Any]) -> None:
    """Write the weights in half precision, and beside them as JSON how they were made."""
    arrays = {
        name: np.asarray(value).astype(np.float16) for name, value in network.state_dict().items()
    }
    data = pack(_FORMAT, arrays)
    path.write_bytes(data)
    record = {**making, "bytes": len(data), "sha256": hashlib.sha256(data).hexdigest()}
    making_of(path).write_text(json.dumps(record, indent=2) + "\n")


def making_of(path: Path) -> Path:
    """Where it says how a file of weights was made."""
    return path.with_name("start.json")
