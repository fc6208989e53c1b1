import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from models.geometry.ground import pixel_from_ground
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.regression.inputs import CHANNELS, network_inputs, scale_points
from models.regression.recipe import DEFAULT, TrainingPlan
from models.simulation.walkers import WalkConfig

# Of the channels of "levelled".
RIGHT, AHEAD, DOWN, FAR, STRIDE_RIGHT, STRIDE_AHEAD, STEEP, RANGE = range(4, 12)


def test_points_span_minus_one_to_one(lens):
    corners = np.array([[[-0.5, -0.5], [1279.5, 719.5], [np.nan, np.nan]]])
    expected = [[[-1, -1], [1, 1], [0, 0]]]
    assert_allclose(scale_points(corners, lens, "points"), expected)
    both = scale_points(corners, lens, "points_and_steps")
    assert_allclose(both, [[[-1, -1, 0, 0], [1, 1, 64, 64], [0, 0, 0, 0]]])


@pytest.fixture
def plan(lens: Intrinsics) -> TrainingPlan:
    """A camera without roll, 6 m high, that looks down by 30 deg and to the east."""
    pose = CameraPose(height_m=6, tilt_rad=math.radians(30), heading_rad=math.radians(90))
    return TrainingPlan(intrinsics=lens, prior_pose=pose, recipe=DEFAULT, walk=WalkConfig(), seed=0)


def seen(plan: TrainingPlan, ground_m: list[list[float]], pose: CameraPose | None = None):
    """What a network reads (T, 12) of somebody at places (T, 2), as a pose sees them."""
    pose = pose or plan.prior_pose
    uv, _ = pixel_from_ground(plan.intrinsics, pose.rotation, pose.centre_m, np.array(ground_m))
    return network_inputs(uv[None], plan)[0].double().numpy()


def test_a_walk_away_at_the_usual_pace_is_one_stride_ahead_a_step(plan):
    # 0.4 s at 1.4 m/s, along the heading; 12 m off, two heights, a ray falls by 1 of sqrt(5).
    found = seen(plan, [[12.0, 0.0], [12.56, 0.0], [13.12, 0.0]])
    assert_allclose(found[:, STRIDE_AHEAD], [0, 1, 1], atol=1e-6)
    assert_allclose(found[:, STRIDE_RIGHT], 0, atol=1e-6)
    assert_allclose(found[0, [RIGHT, AHEAD]], [0, 2 / math.sqrt(5)], atol=1e-6)
    assert found[0, DOWN] == pytest.approx(3 / math.sqrt(5))
    assert found[0, FAR] == pytest.approx(math.log(2.05))
    assert_allclose(found[:, STEEP], 0.5)
    assert_allclose(found[:, RANGE], math.log(0.5))  # 3 m around 6 m


def test_to_the_south_is_to_the_right_of_who_looks_to_the_east(plan):
    found = seen(plan, [[12.0, 0.0], [12.0, -0.56]])
    assert_allclose(found[1, [STRIDE_RIGHT, STRIDE_AHEAD]], [1, 0], atol=1e-6)


def test_from_twice_as_high_strides_look_half_as_long(plan):
    higher = replace(plan.prior_pose, height_m=12.0)
    found = seen(plan, [[24.0, 0.0], [24.56, 0.0]], higher)
    assert found[1, STRIDE_AHEAD] == pytest.approx(0.5)


def test_what_lies_at_the_horizon_or_beyond_stays_finite_and_padding_is_zero(plan):
    uv = np.array([[[640.0, 0.0], [640.0, 20.0], [np.nan, np.nan]]])
    sky = replace(plan, prior_pose=CameraPose(height_m=6, tilt_rad=0.0))
    found = network_inputs(uv, sky)[0].numpy()
    assert np.isfinite(found).all()
    assert (np.abs(found[:2, [STRIDE_RIGHT, STRIDE_AHEAD]]) <= 4).all()
    assert (found[2] == 0).all()
    assert found.shape == (3, CHANNELS["levelled"])
