"""Every number and sign of the conventions, run."""

from math import acos, cos, degrees, radians, sin

import numpy as np
import pytest
from numpy.testing import assert_allclose

from models.geometry.ground import pixel_from_ground
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose, pose_from_matrices
from models.geometry.rotation import angle_between, rotation_from_angles, rotation_from_quaternion

# Published for the Town Centre camera, as x, y, z, w.
X, Y, Z, W = 0.69724918, -0.43029625, 0.28876889, 0.49527897
T = np.array([-0.05988364, 3.83331299, 12.39112186])
LENS = Intrinsics(width=1280, height=720, fx=1000, fy=800, cx=600, cy=300)


def town_centre() -> CameraPose:
    return pose_from_matrices(rotation_from_quaternion([W, X, Y, Z]), T)


def seen(pose: CameraPose, *ground: tuple[float, float]) -> np.ndarray:
    uv, valid = pixel_from_ground(LENS, pose.rotation, pose.centre_m, np.array(ground))
    assert valid.all()
    return uv


def test_town_centre_pin() -> None:
    pose = town_centre()
    assert pose.height_m == pytest.approx(7.844, abs=5e-4)
    assert degrees(pose.tilt_rad) == pytest.approx(20.04, abs=5e-3)
    assert degrees(pose.roll_rad) == pytest.approx(+1.44, abs=5e-3)
    assert degrees(pose.heading_rad) == pytest.approx(61.92, abs=5e-3)


def test_height_is_of_the_centre_and_never_t2() -> None:
    pose = town_centre()
    assert_allclose(pose.translation_m, T, atol=1e-7)
    assert pose.translation_m[2] == pytest.approx(12.39, abs=5e-3)
    assert pose.centre_m[2] == pose.height_m
    assert_allclose(pose.centre_m, -pose.rotation.T @ T, atol=1e-7)


def test_town_centre_quaternion_comes_back_as_wxyz_with_w_not_negative() -> None:
    assert_allclose(town_centre().quaternion_wxyz, [W, X, Y, Z], atol=1e-7)
    from_negative = pose_from_matrices(rotation_from_quaternion([-W, -X, -Y, -Z]), T)
    assert_allclose(from_negative.quaternion_wxyz, [W, X, Y, Z], atol=1e-7)


def test_camera_from_world_is_r_times_x_plus_t() -> None:
    # The centre is the origin of the camera frame; 2 m down the optical axis is (0, 0, 2) there.
    pose = town_centre()
    assert_allclose(pose.rotation @ pose.centre_m + T, [0, 0, 0], atol=1e-6)
    ahead = pose.centre_m + 2 * pose.rotation[2]
    assert_allclose(pose.rotation @ ahead + T, [0, 0, 2], atol=1e-6)


@pytest.mark.parametrize(
    ("tilt_deg", "roll_deg", "heading_deg"), [(20, 10, 60), (-5, -40, 200), (75, 120, -30)]
)
def test_level_axes_formulas(tilt_deg: float, roll_deg: float, heading_deg: float) -> None:
    a, r, h = radians(tilt_deg), radians(roll_deg), radians(heading_deg)
    forward = np.array([sin(h) * cos(a), cos(h) * cos(a), -sin(a)])
    right0 = np.array([cos(h), -sin(h), 0])
    down0 = np.cross(forward, right0)
    right = cos(r) * right0 + sin(r) * down0
    down = -sin(r) * right0 + cos(r) * down0
    assert_allclose(rotation_from_angles(a, r, h), [right, down, forward], atol=1e-12)


def test_tilt_looks_down() -> None:
    expected = [[1, 0, 0], [0, -0.5, -0.8660254], [0, 0.8660254, -0.5]]
    assert_allclose(rotation_from_angles(radians(30), 0, 0), expected, atol=1e-7)


def test_positive_tilt_points_the_axis_below_the_horizon() -> None:
    forward = rotation_from_angles(radians(30), radians(7), radians(50))[2]
    assert forward[2] == pytest.approx(-0.5)


def test_heading_is_clockwise_from_world_y_seen_from_above() -> None:
    assert_allclose(rotation_from_angles(0, 0, 0)[2], [0, 1, 0], atol=1e-12)
    assert_allclose(rotation_from_angles(0, 0, radians(90))[2], [1, 0, 0], atol=1e-12)
    assert_allclose(rotation_from_angles(0, 0, radians(30))[2], [0.5, 0.8660254, 0], atol=1e-7)


def test_positive_roll_lowers_the_cameras_right_side() -> None:
    right = rotation_from_angles(0, radians(30), 0)[0]
    assert right[2] == pytest.approx(-0.5)


def test_positive_roll_makes_the_horizon_climb_to_the_right() -> None:
    # Level, looking along +Y: the horizon is the line through (cx, cy) that climbs by
    # tan(10 deg) to the right, with v counted downwards.
    pose = CameraPose(height_m=1, tilt_rad=0, roll_rad=radians(10), heading_rad=0)
    square = Intrinsics(width=1280, height=720, fx=1000, fy=1000, cx=600, cy=300)
    far = np.array([[-2e6, 1e7], [2e6, 1e7]])
    uv, valid = pixel_from_ground(square, pose.rotation, pose.centre_m, far)
    assert valid.all()
    left, right = uv
    assert left[0] < 600 < right[0]
    assert right[1] < 300 < left[1]
    assert (right[1] - left[1]) / (right[0] - left[0]) == pytest.approx(-0.1763270, abs=1e-5)


def test_pixels_count_u_right_and_v_down() -> None:
    pose = CameraPose(height_m=5, tilt_rad=radians(30))
    middle, right, nearer = seen(pose, (0, 8), (1, 8), (0, 7))
    assert right[0] > middle[0]
    assert nearer[1] > middle[1]


def test_integers_are_pixel_centres() -> None:
    # A picture of 1280 x 720 pixels reaches half a pixel beyond its outermost centres.
    corners = np.array([[-0.5, -0.5], [1279.5, 719.5], [-0.51, 0], [0, 719.51], [1279.51, 0]])
    assert LENS.contains(corners).tolist() == [True, True, False, False, False]


def test_angle_between_is_the_whole_rotation() -> None:
    first = CameraPose(height_m=1, tilt_rad=radians(20), heading_rad=radians(10))
    second = CameraPose(height_m=1, tilt_rad=radians(25), roll_rad=radians(-3))
    q1, q2 = first.quaternion_wxyz, second.quaternion_wxyz
    assert angle_between(q1, q2) == pytest.approx(2 * acos(abs(q1 @ q2)), abs=1e-9)
    # The trace of the relative rotation tells the same angle.
    trace = np.trace(first.rotation @ second.rotation.T)
    assert angle_between(q1, q2) == pytest.approx(acos((trace - 1) / 2), abs=1e-9)


def test_position_and_heading_leave_the_picture_of_the_ground_unchanged() -> None:
    # The same feet, moved and turned about the world's axis together with the camera.
    shape = {"height_m": 6.0, "tilt_rad": radians(25), "roll_rad": radians(4)}
    walk = np.array([[1.0, 9.0], [2.0, 11.0], [-3.0, 14.0]])
    turn = radians(70)  # clockwise from above, as heading
    turned = walk @ np.array([[cos(turn), -sin(turn)], [sin(turn), cos(turn)]])
    here = seen(CameraPose(**shape), *walk)
    there = seen(CameraPose(**shape, heading_rad=turn, x_m=40, y_m=-7), *(turned + (40, -7)))
    assert_allclose(there, here, atol=1e-9)
