from dataclasses import replace
from math import pi, radians

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from models.errors import DegenerateGeometryError
from models.geometry.ground import ground_from_pixel
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.simulation.poses import PoseRange, PoseSet, random_poses, repeated_pose
from models.simulation.walkers import WalkConfig, Walks, simulate_walks

BENT = Intrinsics(
    width=1920, height=1080, fx=2696, fy=2696, cx=959.5, cy=539.5,
    distortion=(-0.6015, 4.702, -0.00047, -0.0078, 0.0),
)  # fmt: skip


def like(pose: CameraPose, count: int, tilt_rad: np.ndarray | None = None) -> PoseSet:
    poses = repeated_pose(pose, count)
    return poses if tilt_rad is None else replace(poses, tilt_rad=tilt_rad)


def paths(lens: Intrinsics, poses: PoseSet, walks: Walks) -> np.ndarray:
    """Where the walks went on the ground (B, T, 2), each seen by its own pose."""
    seen_by = poses.take(walks.pose_idx)
    return ground_from_pixel(lens, seen_by.rotation, seen_by.centre_m, walks.uv)[0]


def simulate(lens: Intrinsics, poses: PoseSet, seed: int = 0, **config: float) -> Walks:
    return simulate_walks(lens, poses, WalkConfig(**config), np.random.default_rng(seed))


@pytest.mark.parametrize(("mean", "sd", "step_s"), [(0.9, 0.2, 0.4), (1.4, 0.1, 1.0), (2, 0, 0.2)])
def test_walkers_have_the_asked_speeds_at_any_step(
    lens: Intrinsics, pose: CameraPose, mean: float, sd: float, step_s: float
) -> None:
    poses = like(pose, 2000)
    walks = simulate(lens, poses, speed_mean_mps=mean, speed_sd_mps=sd, step_s=step_s)
    strides = np.linalg.norm(np.diff(paths(lens, poses, walks), axis=1), axis=-1)
    speed = np.nanmean(strides, axis=1) / step_s
    assert len(walks) == 2000
    assert speed.mean() == pytest.approx(mean, abs=4 * sd / np.sqrt(2000) + 1e-6)
    assert speed.std() == pytest.approx(sd, rel=0.08, abs=1e-6)


def test_speeds_hold_under_distortion_and_over_many_poses() -> None:
    prior = CameraPose(height_m=7.8, tilt_rad=0.35, roll_rad=0.03, heading_rad=1.0, x_m=-9.0)
    poses = random_poses(prior, PoseRange(), 1000, np.random.default_rng(5))
    walks = simulate(BENT, poses)
    strides = np.linalg.norm(np.diff(paths(BENT, poses, walks), axis=1), axis=-1)
    assert BENT.contains(walks.uv[~np.isnan(walks.uv[..., 0])]).all()
    assert_allclose(np.nanmax(strides, axis=1), np.nanmin(strides, axis=1), atol=1e-5)
    assert np.nanmean(strides) / 0.4 == pytest.approx(1.4, abs=0.02)


def test_without_turning_people_walk_straight(lens: Intrinsics, pose: CameraPose) -> None:
    poses = like(pose, 200)
    steps = np.diff(paths(lens, poses, simulate(lens, poses, turn_sd_rad_per_s=0.0)), axis=1)
    aside = steps[:, :-1, 0] * steps[:, 1:, 1] - steps[:, :-1, 1] * steps[:, 1:, 0]
    assert np.nanmax(np.abs(aside)) < 1e-6
    ahead = (steps[:, :-1] * steps[:, 1:]).sum(-1)
    assert np.nanmin(ahead) > 0


def test_each_turns_at_a_steady_rate(lens: Intrinsics, pose: CameraPose) -> None:
    poses = like(pose, 500)
    steps = np.diff(paths(lens, poses, simulate(lens, poses)), axis=1)
    heading = np.arctan2(steps[..., 0], steps[..., 1])
    turn = np.angle(np.exp(1j * np.diff(heading, axis=1)))
    assert np.nanmax(np.nanstd(turn, axis=1)) < 1e-5
    assert np.nanstd(np.nanmean(turn, axis=1)) > radians(1)


def test_people_walk_in_every_direction(lens: Intrinsics, pose: CameraPose) -> None:
    poses = like(pose, 2000)
    steps = np.diff(paths(lens, poses, simulate(lens, poses, turn_sd_rad_per_s=0.0)), axis=1)[:, 0]
    octants, _ = np.histogram(np.arctan2(steps[:, 0], steps[:, 1]), bins=8, range=(-pi, pi))
    assert octants.min() > 2000 / 8 / 2
    # As many come as go: turned round, the walks look the same.
    direction = steps / np.linalg.norm(steps, axis=1, keepdims=True)
    assert np.linalg.norm(direction.mean(axis=0)) < 0.06


def test_the_seed_makes_the_walks(lens: Intrinsics, pose: CameraPose) -> None:
    poses = like(pose, 30)
    first, again, other = (simulate(lens, poses, seed) for seed in (3, 3, 4))
    assert_array_equal(first.uv, again.uv)
    assert_array_equal(first.lengths, again.lengths)
    assert_array_equal(first.pose_idx, again.pose_idx)
    assert not np.array_equal(first.uv, other.uv, equal_nan=True)


def test_the_asked_numbers_of_points_all_occur(lens: Intrinsics, pose: CameraPose) -> None:
    walks = simulate(lens, like(pose, 1000), min_points=5, max_points=8)
    assert walks.uv.shape == (1000, 8, 2)
    assert np.unique(walks.lengths).tolist() == [5, 6, 7, 8]
    assert_array_equal(np.isfinite(walks.uv).all(-1).sum(1), walks.lengths)


def test_nobody_is_followed_beyond_the_farthest_distance(lens: Intrinsics) -> None:
    level = CameraPose(height_m=6, tilt_rad=radians(3), x_m=100.0)
    poses = like(level, 300)
    for farthest_m in (40.0, 25.0):
        ground = paths(lens, poses, simulate(lens, poses, farthest_m=farthest_m))
        distance = np.linalg.norm(ground - (level.x_m, level.y_m), axis=-1)
        assert np.nanmax(distance) < farthest_m + 1e-6
        assert np.nanmax(distance) > 0.9 * farthest_m


def test_a_picture_too_small_for_long_walks_gets_short_ones(lens: Intrinsics) -> None:
    # Straight down from 6 m the picture is 7 m by 3.9 m, 8 m across: 15 strides of 0.56 m at most,
    # fewer for those who walk faster.
    poses = like(CameraPose(height_m=6, tilt_rad=pi / 2), 200)
    walks = simulate(lens, poses, speed_sd_mps=0.0, turn_sd_rad_per_s=0.0)
    assert len(walks) > 100
    assert walks.lengths.min() == 11
    assert walks.lengths.max() <= 15
    for uv, length in zip(walks.uv, walks.lengths, strict=True):
        assert lens.contains(uv[:length]).all()


def test_poses_without_ground_give_no_walk_and_the_others_one(lens: Intrinsics) -> None:
    pose = CameraPose(height_m=6, tilt_rad=0.4)
    sky = np.arange(60) % 3 == 0
    poses = like(pose, 60, tilt_rad=np.where(sky, -1.2, 0.4))
    walks = simulate(lens, poses)
    assert_array_equal(walks.pose_idx, np.flatnonzero(~sky))
    assert len(walks) == len(walks.uv) == len(walks.lengths) == 40


@pytest.mark.parametrize("tilt_deg", [-90, -40])
def test_a_camera_that_sees_only_sky_is_refused_with_its_numbers(
    lens: Intrinsics, tilt_deg: float
) -> None:
    sky = like(CameraPose(height_m=6, tilt_rad=radians(tilt_deg)), 7)
    with pytest.raises(DegenerateGeometryError, match=r"none of 7 .* 60 m .* 11 points"):
        simulate(lens, sky)


def test_ground_that_is_too_far_away_is_none(lens: Intrinsics, pose: CameraPose) -> None:
    with pytest.raises(DegenerateGeometryError, match="within 5 m"):
        simulate(lens, like(pose, 20), farthest_m=5.0)
    assert len(simulate(lens, like(replace(pose, height_m=3.0), 20), farthest_m=25.0)) == 20
