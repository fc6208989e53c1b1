from dataclasses import replace
from math import asin, cos, pi, radians, sin, tan

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from models.geometry.ground import LOWEST_SINE, ground_from_pixel, ground_of_rays, pixel_from_ground
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from tests.strategies import image_points, intrinsics, poses

LENS = Intrinsics(width=1280, height=720, fx=1000, fy=800, cx=600, cy=300)
BARREL = replace(LENS, distortion=(-0.3, 0.0, 0.0, 0.0, 0.0))
# 5 m above (2, -1), looking east and 30 deg down: the axis meets the ground 8.66 m ahead, 10 m away
EAST = CameraPose(height_m=5, tilt_rad=radians(30), heading_rad=radians(90), x_m=2, y_m=-1)
LEVEL = CameraPose(height_m=5, tilt_rad=0)


def pixels(lens: Intrinsics, pose: CameraPose, *ground: tuple[float, float]):
    return pixel_from_ground(lens, pose.rotation, pose.centre_m, np.array(ground))


def grounds(lens: Intrinsics, pose: CameraPose, *uv: tuple[float, float]):
    return ground_from_pixel(lens, pose.rotation, pose.centre_m, np.array(uv))


# Pins: ground point and pixel, derived by hand
PINS = [
    ((10.6602540, -1), (600, 300)),  # on the axis
    ((10.6602540, -2), (700, 300)),  # 1 m to the right (south) at depth 10
    ((7, -1), (600, 514.3593539)),  # 45 deg below the horizon, 15 below the axis: 800 tan 15
    ((10.6602540, 1.5), (350, 300)),  # 2.5 m to the left
]


@pytest.mark.parametrize(("ground", "uv"), PINS)
def test_pixel_of_a_ground_point(ground: tuple[float, float], uv: tuple[float, float]) -> None:
    found, valid = pixels(LENS, EAST, ground)
    assert valid.all()
    assert_allclose(found, [uv], atol=1e-5)


@pytest.mark.parametrize(("ground", "uv"), PINS)
def test_ground_point_of_a_pixel(ground: tuple[float, float], uv: tuple[float, float]) -> None:
    found, valid = grounds(LENS, EAST, uv)
    assert valid.all()
    assert_allclose(found, [ground], atol=1e-6)


def test_roll_turns_the_picture_against_the_camera() -> None:
    # 1 m to the right at depth 10: x, y = (cos 10, -sin 10) / 10 in the camera frame.
    rolled = replace(EAST, roll_rad=radians(10))
    uv, _ = pixels(LENS, rolled, (10.6602540, -2))
    assert_allclose(uv, [[600 + 100 * cos(radians(10)), 300 - 80 * sin(radians(10))]], atol=1e-5)


def test_straight_down_the_picture_is_a_map_with_north_up() -> None:
    # 10 m up: 1 m is 100 px along u and 80 px along v.
    down = CameraPose(height_m=10, tilt_rad=pi / 2, x_m=3, y_m=4)
    uv, valid = pixels(LENS, down, (3, 4), (4, 6))
    assert valid.all()
    assert_allclose(uv, [[600, 300], [700, 140]], atol=1e-6)
    back, valid = grounds(LENS, down, (600, 300), (700, 140))
    assert valid.all()
    assert_allclose(back, [[3, 4], [4, 6]], atol=1e-9)


def test_ground_of_a_ray_is_in_camera_heights_and_scales_with_them() -> None:
    rays = np.array([[0.0, 0.5, 1.0], [0.2, 0.25, 1.0]])
    ground, valid = ground_of_rays(rays, LEVEL.rotation)
    assert valid.all()
    assert_allclose(ground, [[0, 2], [0.8, 4]])
    uv = rays[:, :2] * (LENS.fx, LENS.fy) + (LENS.cx, LENS.cy)
    for height_m in (5.0, 15.0):
        centre = np.array([3.0, -1.0, height_m])
        places, _ = ground_from_pixel(LENS, LEVEL.rotation, centre, uv)
        assert_allclose(places, centre[:2] + height_m * ground)


# Round trips


@given(st.data(), intrinsics(), poses())
def test_ground_round_trip(data: st.DataObject, lens: Intrinsics, pose: CameraPose) -> None:
    uv = data.draw(image_points(lens))
    ground, valid = ground_from_pixel(lens, pose.rotation, pose.centre_m, uv)
    back, seen = pixel_from_ground(lens, pose.rotation, pose.centre_m, ground)
    assert (seen == valid).all()
    assert_allclose(back[valid], uv[valid], atol=1e-5)


@given(st.data(), intrinsics(distorted=False), poses(lowest_tilt_deg=75))
def test_a_camera_that_looks_down_finds_ground_everywhere_near_its_axis(
    data: st.DataObject, lens: Intrinsics, pose: CameraPose
) -> None:
    # Within 10 deg of an axis that is at least 75 deg below the horizon.
    shares = np.array(data.draw(st.lists(st.tuples(*[st.floats(-1, 1)] * 2), min_size=1)))
    rays = shares * tan(radians(10)) / np.sqrt(2)
    uv = rays * (lens.fx, lens.fy) + (lens.cx, lens.cy)
    ground, valid = ground_from_pixel(lens, pose.rotation, pose.centre_m, uv)
    assert valid.all()
    farthest = pose.height_m * tan(radians(25))
    assert (np.linalg.norm(ground - pose.centre_m[:2], axis=1) <= farthest + 1e-6).all()


def test_many_poses_at_once_are_as_one_at_a_time() -> None:
    several = [EAST, replace(EAST, roll_rad=0.3, height_m=9), replace(EAST, tilt_rad=1.0)]
    rotation = np.array([pose.rotation for pose in several])
    centre = np.array([pose.centre_m for pose in several])
    uv = np.random.default_rng(0).uniform((0, 0), (1280, 720), (3, 6, 2))
    ground, valid = ground_from_pixel(BARREL, rotation, centre, uv)
    back, seen = pixel_from_ground(BARREL, rotation, centre, ground)
    assert ground.shape == back.shape == (3, 6, 2)
    assert valid.any(axis=1).all()
    for n, pose in enumerate(several):
        one, one_valid = ground_from_pixel(BARREL, pose.rotation, pose.centre_m, uv[n])
        assert_allclose(ground[n], one, atol=1e-9)
        assert (valid[n] == one_valid).all()
        assert_allclose(
            back[n], pixel_from_ground(BARREL, pose.rotation, pose.centre_m, one)[0], atol=1e-9
        )
        assert (seen[n] == one_valid).all()


# Oracle


@given(intrinsics(), poses(), st.integers(0, 10_000))
def test_pixels_are_those_of_opencv(lens: Intrinsics, pose: CameraPose, seed: int) -> None:
    ground = pose.centre_m[:2] + np.random.default_rng(seed).uniform(-30, 30, (40, 2))
    uv, valid = pixel_from_ground(lens, pose.rotation, pose.centre_m, ground)
    world = np.concatenate([ground, np.zeros((40, 1))], axis=1)
    turn, _ = cv2.Rodrigues(pose.rotation)
    expected, _ = cv2.projectPoints(
        world, turn, pose.translation_m, lens.matrix, np.array(lens.distortion)
    )
    expected = expected[:, 0]
    inside = valid & lens.contains(expected)
    assert_allclose(uv[inside], expected[inside], atol=1e-5)
    # What OpenCV shows of points in front of a camera without a fold is valid.
    in_front = (world @ pose.rotation.T + pose.translation_m)[:, 2] > 1e-6
    if lens.max_radius == np.inf:
        assert (valid == in_front).all()


# Degenerate cases


def test_pixels_at_and_above_the_horizon_have_no_ground() -> None:
    # Level: the horizon is v = 300.
    ground, valid = grounds(LENS, LEVEL, (600, 310), (600, 300), (600, 290), (0, 0))
    assert valid.tolist() == [True, False, False, False]
    assert_allclose(ground[0], [0, 400])  # 5 m * 800 / 10
    assert np.isnan(ground[1:]).all()


def test_the_ground_ends_at_one_angle_below_the_horizon_for_pixels_and_for_rays() -> None:
    """0.3 deg, 200 camera heights away; what is beyond is NaN, or what the caller says."""
    sines = np.array([1.02, 0.98, 0.2, -1.0]) * LOWEST_SINE
    rays = np.stack([np.zeros(4), np.tan(np.arcsin(sines)), np.ones(4)], axis=1)
    ground, valid = ground_of_rays(rays, LEVEL.rotation)
    assert valid.tolist() == [True, False, False, False]
    assert_allclose(ground[0], [0, 1 / tan(asin(1.02 * LOWEST_SINE))])
    assert np.isnan(ground[1:]).all()
    zeroed, _ = ground_of_rays(rays, LEVEL.rotation, beyond=0.0)
    assert_allclose(zeroed, np.nan_to_num(ground))
    uv = rays[:, :2] * (LENS.fx, LENS.fy) + (LENS.cx, LENS.cy)
    places, hits = grounds(LENS, LEVEL, *uv)
    assert (hits == valid).all()
    assert np.isnan(places[1:]).all()


def test_the_horizon_is_tilted_by_roll() -> None:
    # Right side lower: the horizon climbs to the right, so ground begins higher up there.
    rolled = replace(LEVEL, roll_rad=radians(20))
    _, valid = grounds(LENS, rolled, (200, 300), (1000, 300))
    assert valid.tolist() == [False, True]


def test_a_camera_that_looks_up_sees_no_ground() -> None:
    up = CameraPose(height_m=5, tilt_rad=radians(-60))
    u, v = np.meshgrid(np.arange(0, 1280, 160), np.arange(0, 720, 90))
    ground, valid = ground_from_pixel(
        LENS, up.rotation, up.centre_m, np.stack([u, v], -1).reshape(-1, 2)
    )
    assert not valid.any()
    assert np.isnan(ground).all()


def test_ground_behind_the_camera_has_no_pixel() -> None:
    uv, valid = pixels(LENS, LEVEL, (0, 10), (0, -10), (0, 0))
    assert valid.tolist() == [True, False, False]
    assert np.isnan(uv[1:]).all()


def test_ground_that_the_lens_folds_back_has_no_pixel() -> None:
    # Straight down from 10 m, 15 m aside: radius 1.5, folded into the picture at 0.4875.
    down = CameraPose(height_m=10, tilt_rad=pi / 2)
    uv, valid = pixels(BARREL, down, (15, 0), (5, 0))
    assert valid.tolist() == [False, True]
    assert np.isnan(uv[0]).all()


def test_pixels_that_no_ray_reaches_have_no_ground() -> None:
    down = CameraPose(height_m=10, tilt_rad=pi / 2)
    ground, valid = grounds(BARREL, down, (600 + 750, 300), (600 + 600, 300))
    assert valid.tolist() == [False, True]
    assert np.isnan(ground[0]).all()
