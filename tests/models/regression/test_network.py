import math
from dataclasses import replace
from math import pi, radians, sqrt

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose

from models.geometry.ground import pixel_from_ground
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import angle_between
from models.regression.network import (
    CHANNELS,
    PoseRegressor,
    network_for,
    network_inputs,
    offsets_of,
    pose_from_output,
    pose_loss,
    predict_windows,
    scale_points,
)
from models.regression.recipe import DEFAULT, PAPER, Recipe, TrainingPlan
from models.simulation.walkers import WalkConfig
from models.tracks.trajectory import Windows


def plan_of(lens: Intrinsics, pose: CameraPose, recipe: Recipe) -> TrainingPlan:
    return TrainingPlan(intrinsics=lens, prior_pose=pose, recipe=recipe, walk=WalkConfig(), seed=0)


def fresh(recipe: Recipe = PAPER) -> PoseRegressor:
    """A network whose answer depends on every point.

    With torch's first weights each layer halves its signal: the outputs would hardly move.
    """
    torch.manual_seed(1)
    network = network_for(recipe).eval()
    with torch.no_grad():
        for layer in network.modules():
            if isinstance(layer, torch.nn.Linear):
                layer.weight.mul_(2.5)
    return network


def close(first: torch.Tensor, second: torch.Tensor) -> None:
    torch.testing.assert_close(first, second, rtol=1e-4, atol=1e-5)


# The paper's layers


def parameters(channels: int, orientation: int) -> int:
    """Weights and biases, counted by hand from section 3.3."""
    lstm = 2 * (4 * 64 * (channels + 64) + 8 * 64) + 2 * (4 * 64 * (128 + 64) + 8 * 64)
    trunk = (128 + 1) * 256 + (256 + 1) * 1024 + (1024 + 1) * 512
    branch = (512 + 1) * 256 + (256 + 1) * 128
    return lstm + trunk + 2 * branch + (128 + 1) * (1 + orientation)


@pytest.mark.parametrize(
    ("recipe", "channels", "orientation"),
    [(PAPER, 2, 4), (DEFAULT, 12, 2)],
    ids=["paper", "default"],
)
def test_a_recipes_network_has_as_many_parameters_as_the_papers_layers(
    recipe: Recipe, channels: int, orientation: int
) -> None:
    assert parameters(2, 4) == 1_284_229
    count = sum(p.numel() for p in network_for(recipe).parameters())
    assert count == parameters(channels, orientation)
    points = torch.zeros(3, 12, channels)
    assert network_for(recipe)(points, torch.full((3,), 12)).shape == (3, 1 + orientation)


def test_both_directions_are_read() -> None:
    # The first point reaches the end of the forward and the backward half, the last one as well.
    network, lengths = fresh(), torch.tensor([15])
    points = torch.randn(1, 15, 2)
    for place in (0, 7, 14):
        moved = points.clone()
        moved[0, place] += 1
        assert (network(moved, lengths) - network(points, lengths)).abs().max() > 1e-3


def test_only_the_states_of_the_second_layer_are_read() -> None:
    # With nothing coming out of it, the points make no difference.
    network, lengths = fresh(), torch.tensor([15])
    with torch.no_grad():
        for name, weight in network.lstm.named_parameters():
            if "_l1" in name:
                weight.zero_()
    close(network(torch.randn(1, 15, 2), lengths), network(torch.randn(1, 15, 2), lengths))


def test_height_and_orientation_have_branches_of_their_own() -> None:
    network = fresh()
    points, lengths = torch.randn(4, 12, 2), torch.full((4,), 12)
    before = network(points, lengths)
    with torch.no_grad():
        for weight in network.height.parameters():
            weight.add_(0.1)
    after = network(points, lengths)
    assert (after[:, 0] - before[:, 0]).abs().min() > 1e-3
    close(after[:, 1:], before[:, 1:])


# Padding


@pytest.mark.parametrize("garbage", [0.0, 1e6, float("nan")])
def test_what_lies_behind_the_last_point_is_never_read(garbage: float) -> None:
    network, lengths = fresh(), torch.tensor([11, 31, 20, 11])
    clean = torch.randn(4, 31, 2)
    dirty = clean.clone()
    for row, length in zip(dirty, lengths, strict=True):
        row[length:] = garbage
    close(network(dirty, lengths), network(clean, lengths))


def test_rows_of_one_length_ignore_their_padding_too() -> None:
    network, lengths = fresh(), torch.tensor([13, 13])
    clean = torch.randn(2, 31, 2)
    dirty = clean.clone()
    dirty[:, 13:] = float("nan")
    close(network(dirty, lengths), network(clean[:, :13], lengths))


def test_a_row_answers_the_same_alone_and_in_any_company() -> None:
    network = fresh()
    points, lengths = torch.randn(6, 31, 2), torch.tensor([31, 11, 25, 11, 18, 30])
    together = network(points, lengths)
    order = torch.tensor([3, 5, 0, 1, 4, 2])
    close(network(points[order], lengths[order]), together[order])
    for row in range(6):
        alone = network(points[row : row + 1], lengths[row : row + 1])
        assert alone.shape == (1, 5)
        close(alone[0], together[row])


def test_training_gradients_do_not_see_the_padding() -> None:
    network, lengths = fresh(), torch.tensor([11, 20])
    points = torch.randn(2, 31, 2, requires_grad=True)
    network(points, lengths).sum().backward()
    assert (points.grad[0, 11:] == 0).all()
    assert (points.grad[1, 20:] == 0).all()
    assert (points.grad[0, :11] != 0).any(dim=1).all()


# Loss


def loss(output: list[float], height: float, q: list[float], alpha: float = 1.0) -> float:
    return float(
        pose_loss(torch.tensor([output]), torch.tensor([height]), torch.tensor([q]), alpha)
    )


@pytest.mark.parametrize(
    ("output", "height", "q", "alpha", "expected"),
    [
        ([7, 1, 0, 0, 0], 7, [1, 0, 0, 0], 1, 0),
        ([5.5, 1, 0, 0, 0], 7, [1, 0, 0, 0], 1, 1.5),  # |h* - h|, not squared
        ([8.5, 1, 0, 0, 0], 7, [1, 0, 0, 0], 1, 1.5),
        ([7, 9, 0, 0, 0], 7, [1, 0, 0, 0], 1, 0),  # only the direction of q counts
        ([7, -9, 0, 0, 0], 7, [1, 0, 0, 0], 1, 0),  # q and -q are one
        ([7, 0, 3, 0, 0], 7, [1, 0, 0, 0], 1, sqrt(2)),  # a right angle, the largest there is
        ([7, 0.6, 0.8, 0, 0], 7, [1, 0, 0, 0], 1, sqrt(0.8)),  # (0.4, -0.8)
        ([7, -0.6, -0.8, 0, 0], 7, [1, 0, 0, 0], 1, sqrt(0.8)),
        ([6, 0.6, 0.8, 0, 0], 7, [1, 0, 0, 0], 3, 1 + 3 * sqrt(0.8)),
        ([6, 0.6, 0.8, 0, 0], 7, [1, 0, 0, 0], 0, 1),
    ],
)
def test_loss_of_one_row(
    output: list[float], height: float, q: list[float], alpha: float, expected: float
) -> None:
    found = loss([float(x) for x in output], float(height), [float(x) for x in q], float(alpha))
    assert found == pytest.approx(expected, abs=1e-6)
    flipped = loss([float(x) for x in output], float(height), [-float(x) for x in q], float(alpha))
    assert flipped == pytest.approx(expected, abs=1e-6)


def test_loss_of_a_batch_is_the_mean_over_its_rows() -> None:
    outputs = torch.tensor([[5.0, 1, 0, 0, 0], [7.0, 0, 1, 0, 0], [7.0, 1, 0, 0, 0]])
    found = pose_loss(outputs, torch.full((3,), 7.0), torch.tensor([[1.0, 0, 0, 0]] * 3), 1.0)
    assert float(found) == pytest.approx((2 + sqrt(2) + 0) / 3)


def test_a_perfect_answer_has_a_finite_gradient() -> None:
    output = torch.tensor([[7.0, 1, 0, 0, 0]], requires_grad=True)
    pose_loss(output, torch.tensor([7.0]), torch.tensor([[1.0, 0, 0, 0]]), 1.0).backward()
    assert torch.isfinite(output.grad).all()


# Outputs


def test_raw_outputs_are_a_height_and_a_unit_quaternion(lens: Intrinsics, pose: CameraPose) -> None:
    raw = np.array([[6.5, 0, 0, 3, 4.0], [4.0, -2, 0, 0, 0]])
    height, q = pose_from_output(raw, plan_of(lens, pose, PAPER))
    assert height.tolist() == [6.5, 4.0]
    assert_allclose(q, [[0, 0, 0.6, 0.8], [1, 0, 0, 0]], atol=1e-12)


def test_offsets_are_one_at_the_end_of_the_range(lens: Intrinsics, pose: CameraPose) -> None:
    plan = plan_of(lens, pose, DEFAULT)
    ends = offsets_of(
        np.array([pose.height_m, pose.height_m + 3.0, pose.height_m - 1.5]),
        pose.tilt_rad + np.radians([0, -15, 7.5]),
        pose.roll_rad + np.radians([0, 15, -3]),
        plan,
    )
    assert_allclose(ends, [[0, 0, 0], [1, -1, 1], [-0.5, 0.5, -0.2]], atol=1e-12)


def test_offsets_become_a_pose_with_the_priors_heading(lens: Intrinsics, pose: CameraPose) -> None:
    plan = plan_of(lens, pose, DEFAULT)
    height, q = pose_from_output(np.array([[0, 0, 0], [0.5, -1, 0.2]]), plan)
    assert height.tolist() == [pose.height_m, pose.height_m + 1.5]
    moved = replace(pose, tilt_rad=pose.tilt_rad - radians(15), roll_rad=pose.roll_rad + radians(3))
    assert angle_between(q[0], pose.quaternion_wxyz) < 1e-9
    assert angle_between(q[1], moved.quaternion_wxyz) < 1e-9
    assert (q[:, 0] >= 0).all()


def test_a_tilt_beyond_straight_down_is_held_there(lens: Intrinsics, pose: CameraPose) -> None:
    _, q = pose_from_output(np.array([[0.0, 99, 0]]), plan_of(lens, pose, DEFAULT))
    assert angle_between(q[0], replace(pose, tilt_rad=pi / 2).quaternion_wxyz) < 1e-9


# Predictions


def some_windows(count: int, longest: int = 31) -> Windows:
    rng = np.random.default_rng(2)
    lengths = rng.integers(11, longest + 1, count)
    uv = rng.uniform((0, 0), (1280, 720), (count, 31, 2))
    uv[np.arange(31) >= lengths[:, None]] = np.nan
    return Windows(uv=uv, lengths=lengths, owner_idx=np.arange(count))


@pytest.mark.parametrize("recipe", [PAPER, DEFAULT], ids=["paper", "default"])
def test_windows_are_predicted_as_the_network_says_one_by_one(
    lens: Intrinsics, pose: CameraPose, recipe: Recipe
) -> None:
    plan, network, windows = plan_of(lens, pose, recipe), fresh(recipe), some_windows(5)
    height, q = predict_windows(network, windows, plan)
    assert height.shape == (5,)
    assert q.shape == (5, 4)
    assert height.dtype == q.dtype == np.float64
    assert_allclose(np.linalg.norm(q, axis=1), 1)
    for n, length in enumerate(windows.lengths):
        points = network_inputs(windows.uv[n : n + 1, :length], plan)
        with torch.no_grad():
            raw = network(points, torch.tensor([length])).double().numpy()
        one_height, one_q = pose_from_output(raw, plan)
        assert height[n] == pytest.approx(one_height[0], abs=1e-4)
        assert angle_between(q[n], one_q[0]) < 1e-3


def test_many_windows_are_predicted_in_their_order(lens: Intrinsics, pose: CameraPose) -> None:
    plan, network, windows = plan_of(lens, pose, PAPER), fresh(), some_windows(2100, longest=13)
    height, q = predict_windows(network, windows, plan)
    assert len(height) == len(q) == 2100
    tail = Windows(
        uv=windows.uv[-60:], lengths=windows.lengths[-60:], owner_idx=windows.owner_idx[-60:]
    )
    assert_allclose(height[-60:], predict_windows(network, tail, plan)[0], atol=1e-5)


def test_no_window_gives_no_prediction(lens: Intrinsics, pose: CameraPose) -> None:
    height, q = predict_windows(fresh(), some_windows(0), plan_of(lens, pose, PAPER))
    assert height.shape == (0,)
    assert q.shape == (0, 4)


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
