import math
from dataclasses import replace

import numpy as np
import torch
from numpy.testing import assert_allclose

from models.regression.dataset import equal_length_batches, synthetic_set
from models.regression.recipe import PAPER, TrainingPlan
from models.simulation.walkers import WalkConfig


def test_the_papers_set_has_ten_walks_for_each_pose_of_the_grid(lens, pose):
    wide = replace(PAPER.spread, height_step_m=2.0, angle_step_rad=math.radians(10))
    plan = TrainingPlan(
        intrinsics=lens,
        prior_pose=pose,
        recipe=replace(PAPER, spread=wide),
        walk=WalkConfig(),
        seed=0,
    )
    data = synthetic_set(plan, np.random.default_rng(0))
    assert len(data) == 4 * 4 * 4 * 10
    assert len(torch.unique(data.height_m)) == 4
    assert data.points.shape == (640, 31, 2)
    assert_allclose(torch.linalg.vector_norm(data.quaternion, dim=1), 1, atol=1e-6)


def test_batches_have_one_length_and_miss_nobody():
    lengths = np.random.default_rng(0).integers(11, 32, 5000)
    batches = list(equal_length_batches(lengths, 128, np.random.default_rng(1)))
    assert sorted(np.concatenate(batches)) == list(range(5000))
    for rows in batches:
        assert len(set(lengths[rows])) == 1
        assert 64 < len(rows) < 192
