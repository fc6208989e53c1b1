"""Marks in a picture: what they tell of the pose, made by `cv2.projectPoints`."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from models.errors import DegenerateGeometryError
from models.geometry.hints import Hint, HintKind, with_hints
from models.geometry.pose import CameraPose, plane_parameters_of
from models.geometry.usual_pose import usual_pose, usual_sd

POSE = CameraPose(
    height_m=6.0, tilt_rad=math.radians(22), roll_rad=math.radians(2),
    heading_rad=math.radians(40), x_m=3.0, y_m=-2.0,
)  # fmt: skip
MEAN = plane_parameters_of(usual_pose({}))
WIDE = np.diag(usual_sd({}) ** 2)


def seen(lens, *places):
    """Pixels of places (x, y, z)."""
    rotation, _ = cv2.Rodrigues(POSE.rotation)
    matrix = np.array([[lens.fx, 0, lens.cx], [0, lens.fy, lens.cy], [0, 0, 1]])
    found, _ = cv2.projectPoints(
        np.array(places, dtype=np.float64), rotation, POSE.translation_m, matrix, None
    )
    return found[:, 0]


def ahead(forward_m, right_m, up_m=0.0):
    """A place so far before the camera and to the right of it."""
    sine, cosine = math.sin(POSE.heading_rad), math.cos(POSE.heading_rad)
    x_m = POSE.x_m + forward_m * sine + right_m * cosine
    return x_m, POSE.y_m + forward_m * cosine - right_m * sine, up_m


def vertical(lens, length_m=None, forward_m=12.0, right_m=-3.0):
    foot, top = ahead(forward_m, right_m), ahead(forward_m, right_m, 2.5)
    return Hint(kind=HintKind.VERTICAL, points=seen(lens, foot, top), length_m=length_m)


def length(lens, length_m=5.0):
    ends = seen(lens, ahead(12, -2), ahead(12, 3))
    return Hint(kind=HintKind.LENGTH, points=ends, length_m=length_m)


def mapped(lens, *place):
    return Hint(kind=HintKind.MAP_POINT, points=seen(lens, place), place_m=place[:2])


def test_true_marks_tell_the_pose_and_each_makes_it_surer(lens):
    marks = [vertical(lens, 2.5), vertical(lens, 2.5, 10.0, 3.0), length(lens)]
    before = np.sqrt(np.diag(WIDE))
    for number in range(1, len(marks) + 1):
        found = with_hints(MEAN, WIDE, marks[:number], lens)
        sd = np.sqrt(np.diag(found.covariance)[:3])
        assert (sd < before).all()
        before = sd
    error = found.values[:3] - plane_parameters_of(POSE)
    assert (np.abs(error) < sd).all()
    assert np.degrees(sd[:2]).max() < 2.0
    assert max(found.residual_sd) < 1.0
    assert found.values[3:].tolist() == [0.0, 0.0, 0.0]


def test_the_horizon_is_tilt_and_roll(lens):
    """A camera that looks down by 8 deg: cv2 puts what is far away at the horizon."""
    low = CameraPose(height_m=5.0, tilt_rad=math.radians(8), roll_rad=math.radians(-3))
    rays = np.array([(-0.4, 1.0, 0.0), (0.4, 1.0, 0.0)]) @ low.rotation.T
    points = rays[:, :2] / rays[:, 2:] * lens.fx + (lens.cx, lens.cy)
    found = with_hints(MEAN, WIDE, [Hint(kind=HintKind.HORIZON, points=points)], lens)
    assert np.degrees(found.values[:2]) == pytest.approx([8.0, -3.0], abs=0.05)


def test_two_points_of_a_map_tell_where_it_stands_and_north(lens):
    marks = [vertical(lens, 2.5), mapped(lens, *ahead(12, -2)), mapped(lens, *ahead(20, 4))]
    found = with_hints(MEAN, WIDE, marks, lens).pose
    assert math.degrees(found.heading_rad) == pytest.approx(40.0, abs=0.5)
    assert (found.x_m, found.y_m) == pytest.approx((POSE.x_m, POSE.y_m), abs=0.3)
    assert found.height_m == pytest.approx(POSE.height_m, rel=0.03)


def test_a_coarse_map_makes_north_less_sure(lens):
    """Of two places 10 m apart that are each off by 2 m across: sqrt(2) 2 / 10 rad."""
    places = [ahead(14, -5), ahead(14, 5)]
    marks = [replace(mapped(lens, *each), place_sd_m=2.0) for each in places]
    found = with_hints(plane_parameters_of(POSE), np.diag([1e-8] * 3), marks, lens)
    assert math.sqrt(found.covariance[3, 3]) == pytest.approx(math.sqrt(2) * 2 / 10, rel=0.01)


def test_a_mark_that_lies_is_named(lens):
    marks = [vertical(lens, 2.5), vertical(lens, 2.5, 10.0, 3.0), length(lens), length(lens, 9.0)]
    off = with_hints(MEAN, WIDE, marks, lens).residual_sd
    assert np.argmax(off) in (2, 3)
    assert max(off) > 3.0


def test_what_is_on_no_ground_is_refused(lens):
    above = np.array([[10.0, -900.0], [900.0, -900.0]])
    sky = Hint(kind=HintKind.LENGTH, points=above, length_m=5.0)
    with pytest.raises(DegenerateGeometryError):
        with_hints(plane_parameters_of(POSE), 1e-6 * np.eye(3), [sky], lens)
    one = np.array([[300.0, 300.0], [300.0, 300.0]])
    with pytest.raises(DegenerateGeometryError):
        with_hints(MEAN, WIDE, [Hint(kind=HintKind.VERTICAL, points=one)], lens)
