import hashlib
import json
from pathlib import Path

import pytest
import torch

from models.errors import CheckpointError
from studies.base_model.network import SetNetwork
from studies.base_model.stored import SHIPPED, load_base_model, making_of, store_base_model


def test_what_is_stored_is_loaded(tmp_path: Path):
    network, path = SetNetwork(), tmp_path / "base_model.safetensors.gz"
    store_base_model(network, path, {"seed": 5})
    for name, value in load_base_model(path).state_dict().items():
        assert torch.equal(value, network.state_dict()[name])
    record = json.loads(making_of(path).read_text())
    assert record["seed"] == 5
    assert record["sha256"] == hashlib.sha256(path.read_bytes()).hexdigest()


def test_what_is_damaged_missing_or_another_is_refused(tmp_path: Path):
    path = tmp_path / "base_model.safetensors.gz"
    with pytest.raises(CheckpointError, match="base model"):
        load_base_model(path)
    path.write_bytes(SHIPPED.read_bytes()[:-20])
    with pytest.raises(CheckpointError, match="not readable"):
        load_base_model(path)
    store_base_model(torch.nn.Linear(2, 3), path, {})
    with pytest.raises(CheckpointError, match="of another network"):
        load_base_model(path)


def test_the_shipped_one_is_small_and_as_its_record_says():
    record = json.loads(making_of(SHIPPED).read_text())
    data = SHIPPED.read_bytes()
    assert record["bytes"] == len(data) < 600_000
    assert record["sha256"] == hashlib.sha256(data).hexdigest()
    assert record["command"].startswith("python -m studies base-model")
