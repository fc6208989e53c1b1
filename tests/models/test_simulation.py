import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from models.errors import DegenerateGeometryError
from models.geometry.ground import ground_from_pixel
from models.geometry.pose import CameraPose
from models.simulation.poses import PoseRange, PoseSet, grid_poses, random_poses
from models.simulation.walkers import WalkConfig, simulate_walks

TOWN = CameraPose(height_m=7.844, tilt_rad=math.radians(20.04), roll_rad=math.radians(1.44))


def same(pose: CameraPose, count: int) -> PoseSet:
    return PoseSet(
        height_m=np.full(count, pose.height_m),
        tilt_rad=np.full(count, pose.tilt_rad),
        roll_rad=np.full(count, pose.roll_rad),
        heading_rad=pose.heading_rad,
        x_m=pose.x_m,
        y_m=pose.y_m,
    )


def on_ground(lens, pose, walks):
    shape = walks.uv.shape
    ground, _ = ground_from_pixel(lens, pose.rotation, pose.centre_m, walks.uv.reshape(-1, 2))
    return ground.reshape(shape)


def test_the_papers_grid():
    grid = grid_poses(TOWN, PoseRange())
    assert len(grid) == 16**3
    heights = np.unique(grid.height_m.round(9))
    assert_allclose([heights[0], heights[1], heights[-1]], [4.844, 5.244, 10.844])
    tilts = np.degrees(np.unique(grid.tilt_rad.round(12)))
    assert_allclose([tilts[0], tilts[-1], np.diff(tilts).max()], [5.04, 35.04, 2.0], atol=1e-9)
    offsets = np.degrees(np.abs(grid.tilt_rad - TOWN.tilt_rad))
    assert offsets.min() == pytest.approx(1.0)  # the prior pose itself is left out
    assert (grid.heading_rad, grid.x_m, grid.y_m) == (TOWN.heading_rad, TOWN.x_m, TOWN.y_m)


def test_a_low_camera_stays_above_the_ground():
    grid = grid_poses(CameraPose(height_m=2.2, tilt_rad=0.2), PoseRange())
    assert grid.height_m.min() == 0.5
    assert grid.height_m.max() <= 5.2 + 1e-9


def test_random_poses_fill_the_grids_range():
    drawn = random_poses(TOWN, PoseRange(), 5000, np.random.default_rng(1))
    assert np.degrees(drawn.tilt_rad - TOWN.tilt_rad).min() == pytest.approx(-15, abs=0.1)
    assert np.degrees(drawn.roll_rad - TOWN.roll_rad).max() == pytest.approx(15, abs=0.1)
    assert (drawn.height_m.min(), drawn.height_m.max()) == pytest.approx((4.844, 10.844), abs=0.02)


def test_the_same_seed_makes_the_same_walks(lens):
    poses = same(TOWN, 50)
    first, again, other = (
        simulate_walks(lens, poses, WalkConfig(), np.random.default_rng(seed)) for seed in (3, 3, 4)
    )
    assert_array_equal(first.uv, again.uv)
    assert not np.array_equal(first.lengths, other.lengths)


def test_walks_are_inside_the_image_and_of_the_asked_length(lens):
    walks = simulate_walks(lens, same(TOWN, 2000), WalkConfig(), np.random.default_rng(0))
    assert len(walks) == 2000
    assert walks.lengths.min() == 11
    assert walks.lengths.max() == 31
    for uv, length in zip(walks.uv, walks.lengths, strict=True):
        assert lens.contains(uv[:length]).all()
        assert np.isnan(uv[length:]).all()


def test_people_walk_at_the_asked_speeds_and_turn_slowly(lens, pose):
    config = WalkConfig(step_s=0.4)
    walks = simulate_walks(lens, same(pose, 4000), config, np.random.default_rng(0))
    steps = np.diff(on_ground(lens, pose, walks), axis=1)
    length = np.linalg.norm(steps, axis=-1)
    speed = np.nanmean(length, axis=1) / 0.4
    assert np.nanmax(np.nanstd(length, axis=1)) < 1e-6  # each at a constant speed
    assert speed.mean() == pytest.approx(1.4, abs=0.01)
    assert speed.std() == pytest.approx(0.1, abs=0.01)
    heading = np.arctan2(steps[..., 0], steps[..., 1])
    turn = np.angle(np.exp(1j * np.diff(heading, axis=1))) / 0.4
    assert np.degrees(np.nanstd(np.nanmean(turn, axis=1))) == pytest.approx(3.0, rel=0.1)
    # As many come as go: turned round, the walks look the same.
    assert abs(np.exp(1j * heading[:, 0]).mean()) < 0.05


def test_walks_know_their_poses(lens, pose):
    up = CameraPose(height_m=6, tilt_rad=-1.0)
    poses = PoseSet(
        height_m=np.array([up.height_m, pose.height_m, up.height_m]),
        tilt_rad=np.array([up.tilt_rad, pose.tilt_rad, up.tilt_rad]),
        roll_rad=np.zeros(3),
        heading_rad=0.0,
        x_m=0.0,
        y_m=0.0,
    )
    walks = simulate_walks(lens, poses, WalkConfig(), np.random.default_rng(0))
    assert walks.pose_idx.tolist() == [1]  # who looks at the sky sees nobody
    assert poses.take(walks.pose_idx).tilt_rad.tolist() == [pose.tilt_rad]


def test_a_camera_that_sees_only_sky_is_refused(lens):
    with pytest.raises(DegenerateGeometryError, match="none of 20 sees ground within 60 m"):
        simulate_walks(
            lens, same(CameraPose(height_m=6, tilt_rad=-1.0), 20), WalkConfig(),
            np.random.default_rng(0),
        )  # fmt: skip
