"""The base model as it is shipped: a file of weights, and one that says how they were made."""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch

from models.errors import CheckpointError
from models.serialization import Format, from_bytes, to_bytes
from studies.base_model.network import SetNetwork

SHIPPED = Path(__file__).with_name("base_model.safetensors.gz")
_FORMAT = Format(name="base_model", version=1)


def load_base_model(path: Path = SHIPPED) -> SetNetwork:
    """The base model, ready to answer; 0.4 MB of weights.

    Raises:
        CheckpointError: the file is missing, damaged, or of another version.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise CheckpointError(f"base model: {error}") from error
    arrays = from_bytes(_FORMAT, data)
    network = SetNetwork()
    try:
        network.load_state_dict({name: torch.from_numpy(array) for name, array in arrays.items()})
    except (RuntimeError, TypeError) as error:
        raise CheckpointError(f"base model: of another network: {error}") from error
    network.eval()
    return network


def store_base_model(network: SetNetwork, path: Path, making: Mapping[str, Any]) -> None:
    """Write the weights, and beside them as JSON how they were made, with their SHA-256."""
    arrays = {name: np.asarray(value) for name, value in network.state_dict().items()}
    data = to_bytes(_FORMAT, arrays)
    path.write_bytes(data)
    record = {**making, "bytes": len(data), "sha256": hashlib.sha256(data).hexdigest()}
    making_of(path).write_text(json.dumps(record, indent=2) + "\n")


def making_of(path: Path) -> Path:
    """Path of the record of how a file of weights was made."""
    return path.with_name("base_model.json")
