import hashlib
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from models.errors import CheckpointError
from models.regression.checkpoint import START, starting_network
from models.regression.network import network_for
from models.regression.recipe import DEFAULT, PAPER
from studies.regressors.start_training import StartPlan, StartTraining
from studies.regressors.start_weights import held_out_figures, making_of, store_start

pytestmark = pytest.mark.slow

SMALL = StartPlan(seed=3, rounds=2, cameras=2, walks_each=10, batch=10)


def weights(network: torch.nn.Module) -> torch.Tensor:
    return torch.cat([part.flatten() for part in network.state_dict().values()])


def test_the_seed_alone_makes_it_and_it_goes_on_where_it_was_ended(tmp_path: Path):
    straight, ended, other = (
        StartTraining(plan) for plan in (SMALL, SMALL, replace(SMALL, seed=4))
    )
    torch.manual_seed(9)
    losses = [straight.work_round() for _ in range(2)]
    assert np.isfinite(losses).all()
    ended.work_round()
    ended.save(tmp_path / "kept")
    resumed = StartTraining(SMALL)
    resumed.go_on(tmp_path / "kept")
    assert (resumed.done, resumed.walks) == (1, ended.walks)
    assert resumed.work_round() == losses[1]
    assert torch.equal(weights(resumed.network), weights(straight.network))
    other.work_round()
    assert not torch.equal(weights(ended.network), weights(other.network))


def test_what_is_no_training_is_refused(tmp_path: Path):
    (tmp_path / "kept").write_bytes(b"of something else")
    with pytest.raises(CheckpointError, match="no training to go on with"):
        StartTraining(SMALL).go_on(tmp_path / "kept")


def test_rounds_are_of_other_cameras_each():
    heights = [
        [camera.prior_pose.height_m for camera, _ in SMALL.sets(number)] for number in (0, 1, 0)
    ]
    assert heights[0] == heights[2]
    assert not set(heights[0]) & set(heights[1])


def test_what_is_stored_is_loaded_in_half_precision(tmp_path: Path):
    network, path = network_for(DEFAULT), tmp_path / "start.safetensors.gz"
    store_start(network, path, {"seed": 5})
    torch.testing.assert_close(
        weights(starting_network(DEFAULT, path)), weights(network), rtol=1e-3, atol=1e-6
    )
    record = json.loads(making_of(path).read_text())
    assert record["seed"] == 5
    assert record["sha256"] == hashlib.sha256(path.read_bytes()).hexdigest()


def test_what_is_damaged_missing_or_another_is_refused(tmp_path: Path):
    path = tmp_path / "start.safetensors.gz"
    with pytest.raises(CheckpointError, match="starting weights"):
        starting_network(DEFAULT, path)
    path.write_bytes(START.read_bytes()[:-20])
    with pytest.raises(CheckpointError, match="not readable"):
        starting_network(DEFAULT, path)
    store_start(network_for(PAPER), path, {})
    with pytest.raises(CheckpointError, match="starting weights"):
        starting_network(DEFAULT, path)


def test_the_papers_recipe_begins_with_fresh_weights(tmp_path: Path):
    torch.manual_seed(1)
    fresh = network_for(PAPER)
    torch.manual_seed(1)
    assert torch.equal(weights(starting_network(PAPER, tmp_path / "none")), weights(fresh))


def test_the_shipped_ones_are_as_their_record_says():
    record = json.loads(making_of(START).read_text())
    data = START.read_bytes()
    assert record["bytes"] == len(data) < 2_600_000
    assert record["sha256"] == hashlib.sha256(data).hexdigest()
    assert record["command"].startswith("python -m studies start-weights")


def test_they_tell_more_than_the_prior_pose_of_cameras_that_they_never_saw():
    few = StartPlan(seed=77, cameras=12, walks_each=60)
    figures = held_out_figures(starting_network(DEFAULT), few)
    assert figures["off_m"] < 0.75 * figures["prior_m"]
    assert figures["off_deg"] < 0.6 * figures["prior_deg"]
