from dataclasses import replace
from math import log, radians

import numpy as np
import pytest
from numpy.testing import assert_allclose

from models.geometry.ground import pixel_from_ground
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from studies.base_model.features import (
    FEATURES,
    MIRRORED,
    SHORT,
    SHORTER,
    SLOPES,
    SLOPES_APART,
    segment_features,
    walking,
)
from studies.base_model.offsets import moved_by
from studies.base_model.segments import Segments
from studies.simulation.cameras import CameraRange, draw_camera

# Ways of five nodes on the ground, in heights of the camera, to the right and ahead; 4 s each.
WAYS = np.array(
    [
        np.linspace((-0.6, 2.0), (0.2, 2.4), 5),
        np.linspace((0.3, 3.0), (0.1, 1.8), 5),
        np.linspace((0.8, 4.0), (0.9, 4.3), 5),
    ]
)


@pytest.fixture
def plain(pose: CameraPose) -> CameraPose:
    return replace(pose, heading_rad=0.0, x_m=0.0, y_m=0.0)


def segments(lens: Intrinsics, pose: CameraPose, ways: np.ndarray = WAYS) -> Segments:
    ground = ways * pose.height_m
    uv, _ = pixel_from_ground(lens, pose.rotation, pose.centre_m, ground)
    return Segments(
        nodes_uv=uv,
        duration_s=np.full(len(ways), 4.0),
        residual_px=np.full(len(ways), 1e-3 * np.sqrt(lens.fx * lens.fy)),
        owner_idx=np.arange(len(ways)),
    )


def look(
    lens: Intrinsics, pose: CameraPose, seen: Segments, prior: CameraPose | None = None
) -> np.ndarray:
    return segment_features(seen, lens, pose, prior or pose, 1.4)


def test_the_equations_are_the_logs_of_ways_and_of_their_halves(
    lens: Intrinsics, plain: CameraPose
):
    ways = np.array([[[0, 2], [0.1, 2], [0.2, 2], [0.4, 2], [0.6, 2]]], dtype=float)
    found = look(lens, plain, segments(lens, plain, ways))[0]
    expected = 1.4 * 4 / 6.0  # in heights of 6 m
    assert found[SHORT] == pytest.approx(-log(0.6 / expected + 0.02), abs=1e-9)
    slower = log(0.4 / expected * 2 + 0.02) - log(0.2 / expected * 2 + 0.02)
    assert found[SHORTER] == pytest.approx(-slower, abs=1e-9)


def test_slopes_are_what_leaning_does_to_ways(lens: Intrinsics, plain: CameraPose):
    """A way (x, y) to (x', y') seen from a camera that leans otherwise than it believes."""
    seen = segments(lens, plain)
    before, step = look(lens, plain, seen), 1e-6
    for axis in (0, 1):
        offset = np.zeros(3)
        offset[axis] = step
        after = look(lens, moved_by(plain, offset), seen)
        # The least pace of 0.02 in the log makes ways' slopes a little less.
        short = (before[:, SHORT] - after[:, SHORT]) / step
        assert_allclose(short, before[:, SLOPES][:, axis], rtol=0.1)
        apart = (before[:, SHORTER] - after[:, SHORTER]) / step
        assert_allclose(apart, before[:, SLOPES_APART][:, axis], rtol=0.1, atol=0.05)


def test_by_hand_a_way_straight_ahead_loses_twice_its_distance(lens: Intrinsics, plain: CameraPose):
    # From (0, y) to (0, y'): the log length changes by -(y'^2 - y^2) / (y' - y) = -(y + y').
    ways = np.linspace((0.0, 2.0), (0.0, 3.0), 5)[None]
    found = look(lens, plain, segments(lens, plain, ways))[0]
    assert_allclose(found[SLOPES], [-5.0, 0.0], atol=1e-9)


def test_cameras_that_see_the_same_ways_in_heights_see_the_same(
    lens: Intrinsics, plain: CameraPose
):
    """Whatever the lens, the tilt, the roll; and the height, where people are as much taller."""
    found = look(lens, plain, segments(lens, plain))
    rng = np.random.default_rng(2)
    for _ in range(5):
        other, pose = draw_camera(CameraRange(), rng)
        pose = replace(pose, height_m=plain.height_m)
        assert_allclose(look(other, pose, segments(other, pose)), found, atol=1e-6)
    high = replace(plain, height_m=3 * plain.height_m)
    seen = segments(lens, high)
    tripled = segment_features(seen, lens, high, high, 3 * 1.4)
    assert_allclose(tripled, found, atol=1e-9)


def test_the_mirror_changes_signs_where_it_says(lens: Intrinsics, plain: CameraPose):
    level = replace(plain, roll_rad=0.0)
    flipped = look(lens, level, segments(lens, level, WAYS * (-1, 1)))
    signs = np.ones(FEATURES)
    signs[list(MIRRORED)] = -1
    assert_allclose(flipped, look(lens, level, segments(lens, level)) * signs, atol=1e-9)


def test_from_half_the_height_ways_are_half_as_long(lens: Intrinsics, plain: CameraPose):
    seen, low = segments(lens, plain), replace(plain, height_m=plain.height_m / 2)
    before, after = look(lens, plain, seen), look(lens, low, seen, plain)
    assert_allclose(np.exp(-after[:, SHORT]) - 0.02, (np.exp(-before[:, SHORT]) - 0.02) / 2)
    # Of places only how far they are is said in heights of the prior pose.
    same = [0, 1, 17, 18, 19, 20, 21]
    assert_allclose(np.delete(after, same, axis=1), np.delete(before, same, axis=1))


def test_above_the_horizon_and_of_nothing(lens: Intrinsics, plain: CameraPose):
    seen = segments(lens, plain)
    up = moved_by(plain, np.array([-radians(60), 0.0, 0.0]))
    assert np.isfinite(look(lens, up, seen)).all()
    assert look(lens, plain, seen.take(np.arange(0))).shape == (0, FEATURES)


def test_who_stands_or_strays_does_not_walk(lens: Intrinsics, plain: CameraPose):
    straight = np.array([np.linspace((0, 2 + 0.1 * n), (0.9, 2 + 0.1 * n), 5) for n in range(5)])
    standing = straight[:1] * (0.02, 1)
    astray = straight[:1, [0, 2, 4, 2, 1]]
    ways = np.concatenate([straight, standing, astray])
    kept = walking(look(lens, plain, segments(lens, plain, ways)))
    assert kept.tolist() == [True] * 5 + [False, False]
    assert not walking(look(lens, plain, segments(lens, plain, astray))).any()
