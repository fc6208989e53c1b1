import math
from dataclasses import replace

import numpy as np
import pytest

from models.errors import ShapeError
from models.regression.averaging import average_windows, averaged_estimate
from models.regression.network import predict_windows
from models.regression.recipe import PAPER, plan_training
from models.regression.training import check_held_out, train
from models.simulation.poses import repeated_pose
from models.simulation.walkers import WalkConfig, simulate_walks
from models.tracks.trajectory import Windows


def test_the_papers_numbers():
    assert (PAPER.learning_rate, PAPER.batch, PAPER.epochs, PAPER.alpha) == (0.01, 1024, 50, 1.0)
    assert (PAPER.poses, PAPER.walks_per_pose, PAPER.target) == ("grid", 10, "pose")
    assert (PAPER.schedule, PAPER.noise_px, PAPER.inputs) == ("constant", 0.0, "points")


def test_an_unknown_recipe_is_named(lens, pose):
    with pytest.raises(ShapeError, match="recipe: one of .* got 'best'"):
        plan_training(
            intrinsics=lens, prior_pose=pose, recipe_name="best", walk=WalkConfig(), seed=0
        )


def test_a_training_without_an_epoch_is_none(lens, pose):
    with pytest.raises(ShapeError, match="epochs: must be at least 1, got 0"):
        plan_training(
            intrinsics=lens,
            prior_pose=pose,
            recipe_name="default",
            walk=WalkConfig(),
            seed=0,
            epochs=0,
        )


@pytest.mark.nightly
def test_a_short_training_tells_tilt_and_roll_of_single_walks(lens, pose):
    plan = plan_training(
        intrinsics=lens, prior_pose=pose, recipe_name="default", walk=WalkConfig(), seed=0
    )
    # A quarter of the poses: the weights that it starts from have learned the most of it.
    plan = replace(plan, recipe=replace(plan.recipe, random_poses=1024))
    network, metrics = train(plan)
    check_held_out(metrics)
    # 0.32 and 0.49; eight epochs of fresh weights and points and steps alone: 0.36 and 0.48.
    assert metrics.median_angle_error_deg < 0.34 * metrics.prior_angle_error_deg
    assert metrics.median_height_error_m < 0.5 * metrics.prior_height_error_m
    # Its own walks, seen from a camera knocked by 6 deg of tilt: the mean says so.
    knocked = replace(pose, tilt_rad=pose.tilt_rad + math.radians(6))
    walks = simulate_walks(
        lens, repeated_pose(knocked, 300), WalkConfig(), np.random.default_rng(9)
    )
    windows = Windows(uv=walks.uv, lengths=walks.lengths, owner_idx=np.arange(300))
    height, q = predict_windows(network, windows, plan)
    estimate = averaged_estimate(average_windows(height, q, windows.owner_idx)[1], 0)
    assert 4 < math.degrees(estimate.value.tilt_rad - pose.tilt_rad) < 7.5
