from dataclasses import replace
from math import log, radians

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose

from models.errors import ShapeError, TooFewTrajectoriesError
from models.estimation.parameters import plane_parameters_of
from models.geometry.ground import pixel_from_ground
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.regression.set_features import (
    FEATURES,
    MIRRORED,
    usual_speeds,
    walking,
    window_features,
)
from models.regression.set_network import SetNetwork
from models.regression.set_prediction import set_estimate
from models.regression.set_training import SetPlan, gaussian_loss, simulated_sets, train_set
from models.simulation.crowds import FlowConfig
from models.simulation.flows import simulate_sites
from models.simulation.poses import repeated_pose
from models.simulation.walkers import WalkConfig
from models.trajectory import Windows


@pytest.fixture
def plan(lens: Intrinsics, pose: CameraPose) -> SetPlan:
    return SetPlan(
        intrinsics=lens, prior_pose=pose, walk=WalkConfig(), seed=3,
        sites=24, people=16, fewest_people=6, epochs=2, batch=8,
    )  # fmt: skip


def windows_of(lens: Intrinsics, pose: CameraPose, ground: np.ndarray) -> Windows:
    uv, _ = pixel_from_ground(lens, pose.rotation, pose.centre_m, ground)
    padded = np.full((len(uv), 31, 2), np.nan)
    padded[:, : uv.shape[1]] = uv
    return Windows(
        uv=padded,
        lengths=np.full(len(uv), uv.shape[1], dtype=np.int64),
        owner_idx=np.arange(len(uv), dtype=np.int64),
    )


def straight_walks(pose: CameraPose, speeds: list[float], aside: float = 1.0) -> np.ndarray:
    """Walks (B, 11, 2) across the view, some metres ahead, one after another farther away."""
    ahead = np.array([np.sin(pose.heading_rad), np.cos(pose.heading_rad)])
    right = np.array([ahead[1], -ahead[0]]) * aside
    times = 0.4 * (np.arange(11) - 5)
    starts = np.array([pose.x_m, pose.y_m]) + ahead * (14 + 0.5 * np.arange(len(speeds)))[:, None]
    return starts[:, None] + right * (np.array(speeds)[:, None] * times)[..., None]


def look(lens: Intrinsics, pose: CameraPose, windows: Windows, seen_from: CameraPose) -> np.ndarray:
    return window_features(windows, lens, seen_from, pose, 1.4, 0.4)


def some(lens: Intrinsics, pose: CameraPose, people: int = 40, seed: int = 0) -> Windows:
    (walks,) = simulate_sites(
        lens, [repeated_pose(pose, 1)], people, FlowConfig(), WalkConfig(),
        np.random.default_rng(seed),
    )  # fmt: skip
    return Windows(uv=walks.uv, lengths=walks.lengths, owner_idx=np.arange(len(walks)))


def test_from_the_right_pose_pace_is_the_true_one(lens: Intrinsics, pose: CameraPose):
    windows = windows_of(lens, pose, straight_walks(pose, [1.4, 0.7, 2.8]))
    features = look(lens, pose, windows, pose)
    assert features.shape == (3, FEATURES)
    assert_allclose(np.exp(features[:, 6:11]) - 0.02, [[1] * 5, [0.5] * 5, [2] * 5], atol=1e-3)
    low = replace(pose, height_m=pose.height_m / 2)
    assert_allclose(np.exp(look(lens, pose, windows, low)[:, 10]) - 0.02, [0.5, 0.25, 1], atol=1e-3)


def test_features_of_the_mirror_change_sign_where_they_say(lens: Intrinsics, pose: CameraPose):
    level = replace(pose, roll_rad=0.0)
    pinhole = replace(lens, distortion=(0.0,) * 5, cx=(lens.width - 1) / 2)
    windows = some(pinhole, level)
    flipped = replace(windows, uv=np.array([lens.width - 1, 0]) + windows.uv * [-1, 1])
    signs = np.ones(FEATURES)
    signs[list(MIRRORED)] = -1
    assert_allclose(
        look(pinhole, level, flipped, level),
        look(pinhole, level, windows, level) * signs,
        atol=1e-6,
    )


def test_who_stands_or_strays_does_not_walk(lens: Intrinsics, pose: CameraPose):
    ground = straight_walks(pose, [1.4, 1.2, 1.6, 1.5, 1.3, 0.02, 1.4])
    ground[6, 5:] = ground[6, 5::-1]  # there and back
    features = look(lens, pose, windows_of(lens, pose, ground), pose)
    kept = walking(features[None], np.ones((1, 7), dtype=bool))[0]
    assert kept.tolist() == [True] * 5 + [False, False]
    there = np.array([[True] * 7, [False] * 7])
    speeds = usual_speeds(np.stack([features, features]), there, 1.4)
    assert_allclose(speeds, [1.4, 1.4], atol=0.01)  # of nobody, the assumed one
    slow = look(lens, pose, windows_of(lens, pose, straight_walks(pose, [0.9, 1.0, 1.1])), pose)
    assert_allclose(usual_speeds(slow[None], there[:1, :3], 1.4), [1.0], atol=0.01)


def test_the_order_of_windows_does_not_matter_nor_does_padding():
    torch.manual_seed(0)
    network = SetNetwork().eval()
    seen, reference = torch.randn(2, 9, FEATURES), torch.randn(2, 5, FEATURES)
    ones = torch.ones(2, 9), torch.ones(2, 5)
    mean, log_sd = network(seen, ones[0], reference, ones[1])
    order = torch.randperm(9)
    again = network(seen[:, order], ones[0], reference[:, [4, 2, 0, 1, 3]], ones[1])
    torch.testing.assert_close(again, (mean, log_sd))
    padded = torch.cat([seen, 100 * torch.randn(2, 3, FEATURES)], dim=1)
    mask = torch.cat([ones[0], torch.zeros(2, 3)], dim=1)
    torch.testing.assert_close(network(padded, mask, reference, ones[1]), (mean, log_sd))


def test_no_reference_is_one_case_whatever_its_padding():
    torch.manual_seed(0)
    network = SetNetwork().eval()
    seen, ones = torch.randn(1, 9, FEATURES), torch.ones(1, 9)
    empty = network(seen, ones, torch.zeros(1, 0, FEATURES), torch.zeros(1, 0))
    padded = network(seen, ones, torch.randn(1, 4, FEATURES), torch.zeros(1, 4))
    torch.testing.assert_close(padded, empty)


def test_the_loss_is_least_at_the_truth_with_its_own_spread():
    truth = torch.randn(4000, 3, generator=torch.Generator().manual_seed(0))
    losses = {
        log_sd: float(gaussian_loss(torch.zeros(4000, 3), torch.full((4000, 3), log_sd), truth))
        for log_sd in (-0.5, 0.0, 0.5)
    }
    assert min(losses, key=losses.__getitem__) == 0.0
    assert losses[0.0] == pytest.approx(0.5, abs=0.03)


def test_the_seed_alone_makes_the_set_network(plan: SetPlan):
    def weights(plan: SetPlan) -> torch.Tensor:
        return torch.cat([p.flatten() for p in train_set(plan).parameters()]).detach()

    torch.manual_seed(1)
    first = weights(plan)
    torch.manual_seed(2)
    assert torch.equal(weights(plan), first)
    assert not torch.equal(weights(replace(plan, seed=4)), first)


def test_progress_runs_to_one_and_epochs_are_at_least_one(plan: SetPlan):
    shares: list[float] = []
    train_set(plan, shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert len(shares) % 2 == 0
    with pytest.raises(ShapeError, match="epochs: must be at least 1, got 0"):
        plan.with_epochs(0)


def test_simulated_sets_know_their_offsets(plan: SetPlan):
    # Half of the sites stay near the prior pose; a share has no reference.
    data = simulated_sets(replace(plan, sites=400), 400, np.random.default_rng(0))
    limit = np.array([plan.angle_rad, plan.angle_rad, plan.log_height])
    assert (np.abs(data.offsets) <= limit).all()
    near = (np.abs(data.offsets) <= plan.near_share * limit).all(1)
    assert 0.4 < near.mean() < 0.65
    assert 0.08 < (~data.reference_mask.any(1)).mean() < 0.25


def test_a_higher_camera_sees_shorter_ways(plan: SetPlan):
    level = replace(plan, angle_rad=0.0, prior_sd=(0.0, 0.0, 0.0), near_share=1.0)
    data = simulated_sets(level, 100, np.random.default_rng(0))
    known = data.reference_mask.any(1)
    walk = np.where(data.seen_mask, data.seen[..., 10], np.nan)[known]
    pace, rise = np.nanmedian(walk, axis=1), data.offsets[known, 2]
    assert np.polyfit(rise, pace, 1)[0] == pytest.approx(-1, abs=0.15)


def test_too_few_walkers_are_counted(plan: SetPlan, lens: Intrinsics, pose: CameraPose):
    windows = some(lens, pose, people=3)
    with pytest.raises(TooFewTrajectoriesError, match="at least 5 of people who walk"):
        set_estimate(SetNetwork(), plan, windows, None)


@pytest.mark.slow
def test_without_noise_the_moved_pose_is_found(plan: SetPlan, lens: Intrinsics, pose: CameraPose):
    steady = FlowConfig(
        site_speed_log_sd=0.0, speed_slope_log_sd_per_m=0.0, person_speed_log_sd=(0.0, 0.02),
        within_speed_log_sd=(0.0, 0.01), slow_share=(0.0, 0.0), noise_px=(0.01, 0.02),
        turn_sd_rad_per_s=(0.0, 0.01), most_free=1.0,
    )  # fmt: skip
    learned = replace(
        plan, flow=steady, sites=1500, people=40, fewest_people=20, epochs=20, batch=32,
        prior_sd=(0.0, 0.0, 0.0),
    )  # fmt: skip
    network = train_set(learned)
    moved = replace(
        pose, tilt_rad=pose.tilt_rad + radians(4), roll_rad=pose.roll_rad - radians(5),
        height_m=pose.height_m * 1.1,
    )  # fmt: skip
    errors = []
    for seed in range(5):
        views = [repeated_pose(pose, 1), repeated_pose(moved, 1)]
        reference, seen = (
            Windows(uv=w.uv, lengths=w.lengths, owner_idx=np.arange(len(w)))
            for w in simulate_sites(lens, views, 60, steady, WalkConfig(),
                                    np.random.default_rng([seed, 9]))
        )  # fmt: skip
        estimate = set_estimate(network, learned, seen, reference)
        errors.append(estimate.values - plane_parameters_of(moved))
    median = np.median(np.abs(errors), axis=0)
    # Hardly trained, it still finds the most of a move of 4 deg, 5 deg and 10 %.
    assert median[0] < radians(1.0)
    assert median[1] < radians(2.0)
    assert median[2] < 0.05
    assert estimate.values[2] == pytest.approx(log(moved.height_m), abs=0.12)
