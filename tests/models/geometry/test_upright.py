"""Upright people: against a hand-derived number, OpenCV's projection, and the degenerate case."""

import cv2
import numpy as np
from numpy.testing import assert_allclose

from models.geometry.ground import pixel_from_ground
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.upright import stature_ratio, statures, tops_of_boxes, tops_seen

LENS = Intrinsics(width=1920, height=1080, fx=1800, fy=1750, cx=960, cy=500)


def test_a_level_camera_sees_its_own_height_at_the_horizon():
    # Level, 2 m up, a foot at y / z = 0.2 is 10 m off; a top on the horizon is 2 m tall, and one
    # halfway down (y / z = 0.1) is 1 m.
    pose = CameraPose(height_m=2, tilt_rad=0)
    rays = np.array([[0.3, 0.2, 1.0], [0.3, 0.2, 1.0]])
    ratio, ground = stature_ratio(pose.rotation, rays, np.array([0.0, 0.1]))
    assert_allclose(ratio, [1.0, 0.5], atol=1e-12)
    assert_allclose(ground * 2, [[3.0, 10.0]] * 2, atol=1e-9)


def test_statures_undo_opencvs_projection_of_a_rolled_camera():
    pose = CameraPose(height_m=5, tilt_rad=0.3, roll_rad=-0.2, heading_rad=0.7, x_m=1, y_m=-2)
    forward = np.array([np.sin(0.7), np.cos(0.7)])
    ground = pose.centre_m[:2] + np.outer([9.0, 12.0, 20.0], forward) + [[0, 1], [1, 0], [2, -2]]
    tall = np.array([1.5, 1.7, 1.9])
    rvec, _ = cv2.Rodrigues(pose.rotation)
    tops, _ = cv2.projectPoints(
        np.c_[ground, tall], rvec, pose.translation_m, LENS.matrix, np.zeros(5)
    )
    seen = tops_seen(LENS, pose.rotation, pose.centre_m, ground, tall)
    assert_allclose(seen, tops[:, 0, 1], atol=1e-6)
    uv, _ = pixel_from_ground(LENS, pose.rotation, pose.centre_m, ground)
    measured, valid = statures(LENS, pose.rotation, pose.height_m, uv, seen)
    assert valid.all()
    assert_allclose(measured, tall, atol=1e-9)


def test_what_cannot_be_measured_is_nan_and_not_valid():
    pose = CameraPose(height_m=5, tilt_rad=0.3)
    uv = np.array([[960.0, 600.0], [960.0, -600.0], [960.0, 600.0]])  # the second: the sky
    measured, valid = statures(LENS, pose.rotation, 5.0, uv, np.array([np.nan, -900.0, 500.0]))
    assert valid.tolist() == [False, False, True]
    assert np.isnan(measured[:2]).all()
    assert measured[2] > 0


def test_boxes_cut_by_the_border_have_no_top():
    boxes = np.array(
        [[10, 20, 50, 200], [10, 0, 50, 200], [0, 20, 50, 200], [10, 20, 50, 1080], [9, 30, 40, 20]]
    )
    tops = tops_of_boxes(LENS, boxes.astype(float))
    assert tops[0] == 20
    assert np.isnan(tops[1:]).all()
