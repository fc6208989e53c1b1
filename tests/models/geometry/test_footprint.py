"""The ground that a camera sees, worked out by hand."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from models.geometry.footprint import view_outline
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose

# 45 deg to each side and up and down; looks down by 45: from straight down to the horizon.
LENS = Intrinsics(width=1000, height=1000, fx=500, fy=500, cx=499.5, cy=499.5)
POSE = CameraPose(height_m=10.0, tilt_rad=math.radians(45), x_m=3.0, y_m=-2.0)


def test_a_view_goes_from_its_near_edge_to_its_reach():
    outline = view_outline(LENS, POSE, 100.0) - POSE.centre_m[:2]
    # The middle of the lower edge is straight down. A corner's ray is 1 to the side, and down and
    # forward by 1 each, which is sqrt 2 straight down: it lands 10 / sqrt 2 to the side.
    near = outline[np.abs(outline[:, 1]) < 1e-6]
    assert_allclose([near[:, 0].min(), near[:, 0].max()], [-7.0711, 7.0711], atol=1e-3)
    away = np.linalg.norm(outline, axis=1)
    assert away.max() == pytest.approx(100.0)
    assert outline[:, 1].min() > -1e-6


def test_heading_turns_the_view_clockwise():
    east = CameraPose(height_m=10.0, tilt_rad=math.radians(45), heading_rad=math.radians(90))
    outline = view_outline(LENS, east, 50.0)
    assert outline[:, 0].min() > -1e-6  # it looks along +X
    assert outline[:, 0].max() == pytest.approx(50.0, rel=1e-3)


def test_a_camera_that_looks_at_the_sky_sees_nothing_near():
    up = CameraPose(height_m=10.0, tilt_rad=math.radians(-60))
    assert np.linalg.norm(view_outline(LENS, up, 30.0), axis=1).min() == pytest.approx(30.0)
