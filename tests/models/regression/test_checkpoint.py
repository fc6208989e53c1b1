import hashlib
import json
import os
import pickle
from dataclasses import asdict, replace

import pytest
import torch

from models.errors import CheckpointError
from models.regression.checkpoint import (
    load_weights,
    save_weights,
    starting_network,
    weights_path,
)
from models.regression.network import network_for
from models.regression.recipe import DEFAULT, PAPER, TrainingPlan, plan_from_config, plan_to_config
from models.simulation.walkers import WalkConfig


@pytest.fixture
def plan(lens, pose) -> TrainingPlan:
    small = replace(DEFAULT, random_poses=100, walks_per_pose=2, epochs=2, batch=64)
    return TrainingPlan(intrinsics=lens, prior_pose=pose, recipe=small, walk=WalkConfig(), seed=5)


def test_weights_go_to_a_file_of_their_hash_and_back(plan, tmp_path):
    network = network_for(plan.recipe).eval()
    digest = save_weights(network, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == [f"{digest}.safetensors"]
    again = load_weights(tmp_path, digest, plan.recipe)
    points = torch.randn(4, 20, 12)
    lengths = torch.full((4,), 20)
    torch.testing.assert_close(again(points, lengths), network(points, lengths))


def test_missing_damaged_or_foreign_weights_are_refused(plan, tmp_path):
    digest = save_weights(network_for(plan.recipe), tmp_path)
    with pytest.raises(CheckpointError, match="not of recipe paper"):
        load_weights(tmp_path, digest, PAPER)
    path = weights_path(tmp_path, digest)
    path.write_bytes(path.read_bytes()[:-1] + b"x")
    with pytest.raises(CheckpointError, match="damaged"):
        load_weights(tmp_path, digest, plan.recipe)
    with pytest.raises(CheckpointError, match="No such file"):
        load_weights(tmp_path, "0" * 64, plan.recipe)


class Touch:
    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.system, (f"touch {self.path}",)


def test_weights_with_code_in_them_are_refused_unread(plan, tmp_path):
    """A file of torch's own is a pickle, whatever its name and hash say."""
    for name, kept in (("torch", torch.save), ("pickle", pickle.dump)):
        path = tmp_path / name
        with path.open("wb") as file:
            kept({"weight": Touch(tmp_path / "pwned")}, file)
        data = path.read_bytes()
        digest = hashlib.sha256(data).hexdigest()
        weights_path(tmp_path, digest).write_bytes(data)
        with pytest.raises(CheckpointError, match="not of recipe default"):
            load_weights(tmp_path, digest, plan.recipe)
        with pytest.raises(CheckpointError, match="not readable"):
            starting_network(plan.recipe, path)
    assert not (tmp_path / "pwned").exists()


def test_no_name_of_weights_leads_out_of_their_folder(tmp_path):
    assert weights_path(tmp_path, "../../home/ab").parent == tmp_path


def test_a_plan_survives_json(plan):
    assert plan_from_config(json.loads(json.dumps(plan_to_config(plan)))) == plan
    with pytest.raises(CheckpointError, match="not of this version"):
        plan_from_config({**asdict(plan), "walk": {"gait": 3}})
