import math
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from numpy.testing import assert_allclose

from models.geometry.ground import ground_from_pixel
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from service.pages.drawings.picture import Overlay, grid_path, ground_of, horizon_path, picture_svg
from service.pages.drawings.svg_paths import Frame, path_data

LENS = Intrinsics(width=1280, height=720, fx=1100, fy=1000, cx=639.5, cy=359.5)
BENT = Intrinsics(
    width=1280, height=720, fx=1100, fy=1000, cx=639.5, cy=359.5,
    distortion=(-0.3, 0.1, 0.0, 0.0, 0.0),
)  # fmt: skip
FRAME = Frame(left=0, top=0, right=10, bottom=5)


def posed(tilt_deg, roll_deg=0.0, height_m=6.0):
    return CameraPose(
        height_m=height_m,
        tilt_rad=math.radians(tilt_deg),
        roll_rad=math.radians(roll_deg),
        heading_rad=0.7,
        x_m=3.0,
        y_m=-8.0,
    )


def points(path):
    return np.array([[float(x) for x in pair.split()] for pair in re.split("[ML]", path) if pair])


def test_the_horizon_is_drawn_where_it_is():
    path = horizon_path(LENS, posed(10.0))
    v = 359.5 - 1000 * math.tan(math.radians(10))
    assert path == f"M-0.5 {v:.1f}L1279.5 {v:.1f}"  # a straight line has two points
    assert horizon_path(LENS, posed(40.0)) == ""


def test_a_zigzag_that_grows_for_thousands_of_points_is_drawn():
    n = np.arange(3000.0)
    zigzag = np.stack([0.001 * n, 1 + 0.001 * n * (-1) ** n], axis=1)[:, ::-1]
    frame = Frame(left=-10, top=-10, right=10, bottom=10)
    assert len(points(path_data([zigzag], frame))) > 2000


def test_a_bent_horizon_has_more_points():
    drawn = points(horizon_path(BENT, posed(10.0)))
    assert len(drawn) > 5
    assert np.ptp(drawn[:, 1]) > 3


def test_the_grid_lies_on_the_ground_in_whole_squares():
    pose = posed(25.0, roll_deg=3.0)
    ground = ground_of(LENS, pose)
    drawn = points(grid_path(LENS, pose, ground))
    assert len(drawn) > 40
    u, v = drawn.T
    assert (u >= -0.55).all()
    assert (u <= 1279.55).all()
    assert (v >= -0.55).all()
    assert (v <= 719.55).all()
    inside = drawn[(u > 0) & (u < 1279) & (v > 200) & (v < 719)]
    on_ground, hits = ground_from_pixel(LENS, pose.rotation, pose.centre_m, inside)
    local = (on_ground[hits] - ground.foot_m) @ np.array([ground.right, ground.forward]).T
    off = np.abs(local / ground.spacing_m - np.round(local / ground.spacing_m)).min(1)
    assert (off < 0.1).all()


def test_the_same_grid_parts_where_a_camera_was_knocked():
    ground = ground_of(LENS, posed(25.0))
    assert grid_path(LENS, posed(25.0), ground) != grid_path(LENS, posed(28.0), ground)


def test_there_is_no_grid_in_the_sky():
    assert ground_of(LENS, posed(-40.0)) is None
    drawn = picture_svg(LENS, [Overlay(pose=posed(-40.0), kind="prior")], label="sky")
    assert 'class="grid' not in drawn
    assert "nothing but sky" in drawn


@pytest.mark.parametrize("tilt_deg", [-20.0, 0.0, 45.0, 90.0])
@pytest.mark.parametrize("lens", [LENS, BENT])
def test_what_is_drawn_is_well_formed_whatever_the_pose(lens, tilt_deg):
    svg = picture_svg(
        lens,
        [Overlay(pose=posed(tilt_deg, roll_deg=170.0, height_m=0.3), kind="served")],
        [np.array([[10.0, 20.0], [np.nan, 5.0], [30.0, 4000.0]])],
        label='"<script>',
        snapshot_url='/x"y',
    )
    root = ET.fromstring(svg)
    assert root.get("aria-label") == '"<script>'
    assert "nan" not in svg


def test_lines_are_cut_at_the_frame_and_broken_where_they_leave_it():
    line = np.array([[-5.0, 2.5], [5.0, 2.5], [5.0, 20.0], [6.0, 20.0], [6.0, 0.0]])
    assert path_data([line], FRAME) == "M0.0 2.5L5.0 2.5L5.0 5.0M6.0 5.0L6.0 0.0"
    assert path_data([np.array([[11.0, 1.0], [12.0, 2.0]])], FRAME) == ""
    assert path_data([np.array([[1.0, 1.0], [np.nan, 2.0], [2.0, 2.0]])], FRAME) == ""


def test_a_diagonal_outside_a_corner_is_not_drawn():
    assert path_data([np.array([[9.0, -3.0], [13.0, 1.0]])], FRAME) == ""


def test_thinning_keeps_bows():
    angle = np.linspace(0, np.pi, 200)
    bow = np.stack([5 - 4 * np.cos(angle), 4 * np.sin(angle)], axis=-1)
    drawn = points(path_data([bow], FRAME))
    assert 4 < len(drawn) < 60
    assert_allclose(np.hypot(drawn[:, 0] - 5, drawn[:, 1]), 4, atol=0.1)
