import math

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from models.geometry.ground import ground_share, horizon_pixels
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose

LENS = Intrinsics(width=1280, height=720, fx=1100, fy=1000, cx=639.5, cy=359.5)
BENT = Intrinsics(
    width=1280, height=720, fx=1100, fy=1000, cx=639.5, cy=359.5,
    distortion=(-0.2, 0.05, 0.001, -0.002, 0.0),
)  # fmt: skip


def posed(tilt_deg, roll_deg=0.0, heading_deg=40.0):
    return CameraPose(
        height_m=6.0,
        tilt_rad=math.radians(tilt_deg),
        roll_rad=math.radians(roll_deg),
        heading_rad=math.radians(heading_deg),
        x_m=3.0,
    )


@pytest.mark.parametrize("tilt_deg", [-12.0, 0.0, 15.0])
def test_a_level_cameras_horizon_is_a_line_above_the_middle_where_it_looks_down(tilt_deg):
    uv, valid = horizon_pixels(LENS, posed(tilt_deg))
    assert_allclose(uv[valid][:, 1], 359.5 - 1000 * math.tan(math.radians(tilt_deg)), atol=1e-6)
    assert (np.diff(uv[valid][:, 0]) > 0).all()  # from left to right


def test_it_climbs_to_the_right_where_the_right_side_is_lower():
    square = Intrinsics(width=1280, height=720, fx=1000, fy=1000, cx=639.5, cy=359.5)
    uv, valid = horizon_pixels(square, posed(10.0, roll_deg=5.0))
    seen = uv[valid & square.contains(uv)]
    rise, run = seen[-1] - seen[0]
    assert_allclose(run / rise, -math.tan(math.radians(5)), atol=1e-9)


def test_it_bends_with_the_lens_as_opencv_says():
    pose = posed(12.0, roll_deg=-4.0)
    uv, valid = horizon_pixels(BENT, pose, points=73)
    azimuth = pose.heading_rad + np.linspace(-np.pi, np.pi, 73)
    far = np.stack([np.sin(azimuth), np.cos(azimuth), np.zeros(73)], axis=-1)
    expected, _ = cv2.projectPoints(
        far, cv2.Rodrigues(pose.rotation)[0], np.zeros(3), BENT.matrix, np.array(BENT.distortion)
    )
    near = valid & BENT.contains(uv, 200)
    assert near.sum() > 5
    assert_allclose(uv[near], expected[near, 0], atol=1e-6)


def test_the_share_of_ground():
    assert ground_share(LENS, posed(60.0)) == 1.0
    assert ground_share(LENS, posed(-40.0)) == 0.0
    assert 0.45 < ground_share(LENS, posed(0.0)) < 0.55
