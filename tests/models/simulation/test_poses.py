from math import pi, radians

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from models.geometry.pose import CameraPose
from models.simulation.poses import PoseRange, PoseSet, grid_poses, random_poses

TOWN = CameraPose(
    height_m=7.844,
    tilt_rad=radians(20.04),
    roll_rad=radians(1.44),
    heading_rad=radians(61.92),
    x_m=-9.04,
    y_m=-5.0,
)
MAKERS = {
    "grid": lambda prior: grid_poses(prior, PoseRange()),
    "random": lambda prior: random_poses(prior, PoseRange(), 500, np.random.default_rng(0)),
}


def test_the_papers_grid_has_every_combination_once() -> None:
    grid = grid_poses(TOWN, PoseRange())
    rows = np.stack([grid.height_m, grid.tilt_rad, grid.roll_rad], axis=1).round(9)
    assert len(np.unique(rows, axis=0)) == len(grid) == 4096
    assert [len(np.unique(axis)) for axis in rows.T] == [16, 16, 16]


def test_the_prior_pose_is_not_on_the_grid() -> None:
    # The nearest ones are half a step off on every axis: 0.2 m and 1 deg.
    grid = grid_poses(TOWN, PoseRange())
    assert np.abs(grid.height_m - TOWN.height_m).min() == pytest.approx(0.2)
    assert np.abs(grid.tilt_rad - TOWN.tilt_rad).min() == pytest.approx(radians(1))
    assert np.abs(grid.roll_rad - TOWN.roll_rad).min() == pytest.approx(radians(1))


def test_both_ends_of_the_grid_are_reached() -> None:
    roll_deg = np.degrees(grid_poses(TOWN, PoseRange()).roll_rad - TOWN.roll_rad)
    assert_allclose(np.unique(roll_deg.round(6)), np.arange(-15, 16, 2))


def test_a_range_that_is_no_multiple_of_its_step_is_not_overrun() -> None:
    spread = PoseRange(height_m=1.0, height_step_m=0.75, angle_rad=0.1, angle_step_rad=0.2)
    grid = grid_poses(TOWN, spread)
    assert_allclose(np.unique(grid.height_m), [6.844, 7.594, 8.344])
    assert len(grid) == 3 * 2 * 2


@pytest.mark.parametrize("maker", MAKERS)
def test_what_the_ground_does_not_show_is_the_priors(maker: str) -> None:
    made = MAKERS[maker](TOWN)
    assert (made.heading_rad, made.x_m, made.y_m) == (TOWN.heading_rad, TOWN.x_m, TOWN.y_m)


@pytest.mark.parametrize("maker", MAKERS)
@pytest.mark.parametrize("height_m", [0.3, 1.0, 3.2])
def test_no_pose_is_lower_than_the_floor(maker: str, height_m: float) -> None:
    made = MAKERS[maker](CameraPose(height_m=height_m, tilt_rad=0.3))
    assert made.height_m.min() == pytest.approx(0.5, abs=0.05)
    assert made.height_m.min() >= 0.5
    assert made.height_m.max() <= height_m + 3 + 1e-9


@pytest.mark.parametrize("maker", MAKERS)
@pytest.mark.parametrize("tilt_deg", [88, -88])
def test_no_pose_is_tilted_beyond_the_vertical(maker: str, tilt_deg: float) -> None:
    made = MAKERS[maker](CameraPose(height_m=6, tilt_rad=radians(tilt_deg)))
    assert np.abs(made.tilt_rad).max() == pytest.approx(pi / 2)


def test_random_poses_are_even_over_the_range() -> None:
    made = random_poses(TOWN, PoseRange(), 20_000, np.random.default_rng(1))
    for values, middle, half in (
        (made.height_m, TOWN.height_m, 3.0),
        (made.tilt_rad, TOWN.tilt_rad, radians(15)),
        (made.roll_rad, TOWN.roll_rad, radians(15)),
    ):
        share, _ = np.histogram(values, bins=5, range=(middle - half, middle + half))
        assert share.sum() == 20_000
        assert_allclose(share / 20_000, 0.2, atol=0.012)  # 4 standard deviations
    assert abs(np.corrcoef(made.tilt_rad, made.roll_rad)[0, 1]) < 0.03
    assert abs(np.corrcoef(made.height_m, made.tilt_rad)[0, 1]) < 0.03


def test_the_seed_makes_the_random_poses() -> None:
    first, again, other = (
        random_poses(TOWN, PoseRange(), 10, np.random.default_rng(seed)) for seed in (1, 1, 2)
    )
    assert_array_equal(first.tilt_rad, again.tilt_rad)
    assert_array_equal(first.height_m, again.height_m)
    assert not np.array_equal(first.height_m, other.height_m)


def test_taking_keeps_the_order_and_repeats() -> None:
    poses = PoseSet(
        height_m=np.array([4.0, 5, 6]),
        tilt_rad=np.array([0.1, 0.2, 0.3]),
        roll_rad=np.array([-0.1, 0, 0.1]),
        heading_rad=1.0,
        x_m=2.0,
        y_m=3.0,
    )
    taken = poses.take(np.array([2, 0, 2]))
    assert taken.height_m.tolist() == [6, 4, 6]
    assert taken.tilt_rad.tolist() == [0.3, 0.1, 0.3]
    assert taken.roll_rad.tolist() == [0.1, -0.1, 0.1]
    assert (taken.heading_rad, taken.x_m, taken.y_m, len(taken)) == (1, 2, 3, 3)


def test_arrays_of_a_set_are_those_of_its_poses() -> None:
    poses = random_poses(TOWN, PoseRange(), 4, np.random.default_rng(3))
    assert poses.rotation.shape == (4, 3, 3)
    assert poses.centre_m.shape == (4, 3)
    for n in range(4):
        one = CameraPose(
            height_m=poses.height_m[n],
            tilt_rad=poses.tilt_rad[n],
            roll_rad=poses.roll_rad[n],
            heading_rad=TOWN.heading_rad,
            x_m=TOWN.x_m,
            y_m=TOWN.y_m,
        )
        assert_allclose(poses.rotation[n], one.rotation, atol=1e-12)
        assert_allclose(poses.centre_m[n], one.centre_m, atol=1e-12)
