"""The pose in a homography of the ground: a pin, round trips, and what contradicts the lens."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from models.errors import DegenerateGeometryError
from models.geometry.ground_homography import inverse_homography, pose_from_homography
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import rotation_from_vector

LENS = Intrinsics(width=1920, height=1080, fx=1500.0, fy=1480.0, cx=950.0, cy=545.0)
POSE = CameraPose.of_degrees(
    height_m=6.5, tilt_deg=24.0, roll_deg=-3.0, heading_deg=115.0, x_m=12.0, y_m=-40.0
)


def homography(pose=POSE, lens=LENS):
    return lens.matrix @ np.column_stack([pose.rotation[:, :2], pose.translation_m])


def test_straight_down_from_ten_metres():
    """Pin: 10 m above the origin, straight down, 1 m to the east is 100 px of fx 1000 right."""
    lens = Intrinsics(width=1000, height=1000, fx=1000, fy=1000, cx=499.5, cy=499.5)
    matrix = np.array([[100.0, 0, 499.5], [0, -100.0, 499.5], [0, 0, 1]])
    pose = pose_from_homography(matrix, lens)
    assert pose.height_m == pytest.approx(10.0)
    assert math.degrees(pose.tilt_rad) == pytest.approx(90.0)
    assert (pose.x_m, pose.y_m) == pytest.approx((0.0, 0.0), abs=1e-9)


@given(
    st.floats(2.0, 40.0), st.floats(8.0, 80.0), st.floats(-20, 20), st.floats(-179, 179),
    st.sampled_from([1.0, -1.0, 1e-4, -3e5]),
)  # fmt: skip
def test_pose_survives_the_round_trip_at_any_scale(height_m, tilt, roll, heading, factor):
    pose = CameraPose.of_degrees(
        height_m=height_m, tilt_deg=tilt, roll_deg=roll, heading_deg=heading, x_m=5.0, y_m=-2.0
    )
    found = pose_from_homography(factor * homography(pose), LENS)
    assert_allclose(found.centre_m, pose.centre_m, rtol=1e-7)
    assert_allclose(found.rotation, pose.rotation, atol=1e-9)
    back = inverse_homography(factor * inverse_homography(homography(pose)))
    assert_allclose(pose_from_homography(back, LENS).centre_m, pose.centre_m, rtol=1e-6)


def test_homography_of_clicked_points_gives_about_the_pose():
    rng = np.random.default_rng(5)
    ahead = np.array([math.sin(POSE.heading_rad), math.cos(POSE.heading_rad)])
    aside = np.array([ahead[1], -ahead[0]])
    places = [POSE.centre_m[:2] + f * ahead + s * aside for f in (9, 14, 20) for s in (-4, 0, 4)]
    ground = np.column_stack([places, np.ones(9)])
    seen = ground @ homography().T
    clicked = seen[:, :2] / seen[:, 2:] + rng.normal(0, 2.0, (9, 2))
    matrix, _ = cv2.findHomography(ground[:, :2], clicked)
    pose = pose_from_homography(matrix, LENS)
    assert pose.height_m == pytest.approx(6.5, rel=0.05)
    assert math.degrees(pose.tilt_rad) == pytest.approx(24.0, abs=1.0)


@pytest.mark.parametrize(
    ("matrix", "reason"),
    [
        (np.zeros((3, 3)), "must have 9 finite numbers"),
        (np.ones((3, 3)), r"must have an inverse \(got a determinant of 0\)"),
        # Longitude and latitude at 45 deg N: a degree is 78847 m and 111132 m.
        (homography() @ np.diag([78_847.0, 111_132.0, 1.0]), r"in the same unit.* \(got 1.41\)"),
        (homography() @ np.array([[1, 0.5, 0], [0, 1, 0], [0, 0, 1.0]]),
         r"at right angles within 10 deg \(got 26"),
        (homography() @ np.diag([1.0, -1.0, 1.0]), "is y of the ground mirrored"),
        (homography(lens=Intrinsics(width=1280, height=720, fx=1000, fy=987, cx=633, cy=363)),
         "homography: "),
    ],
)  # fmt: skip
def test_homography_that_contradicts_the_lens_is_rejected(matrix, reason):
    with pytest.raises(DegenerateGeometryError, match=reason):
        pose_from_homography(matrix, LENS)


def test_inverse_of_a_singular_homography_is_rejected():
    with pytest.raises(DegenerateGeometryError, match="must have an inverse"):
        inverse_homography(np.ones((3, 3)))


@given(st.lists(st.floats(-4, 4), min_size=3, max_size=3))
def test_rotation_vector_is_opencvs(vector):
    assert_allclose(rotation_from_vector(vector), cv2.Rodrigues(np.array(vector))[0], atol=1e-9)
