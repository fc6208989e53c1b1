"""The ground from above: what is where, on a camera whose view is worked out by hand."""

import math
import re

import numpy as np
import pytest

from models.geometry.ground import misplacements, pixel_from_ground
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from service.pages.drawings.ground_plan import ground_plan_svg, plan_around
from service.pages.drawings.picture import Overlay

# 45 deg to each side and up and down; looks down by 45: from straight down to the horizon.
LENS = Intrinsics(width=1000, height=1000, fx=500, fy=500, cx=499.5, cy=499.5)
POSE = CameraPose(height_m=10.0, tilt_rad=math.radians(45), x_m=3.0, y_m=-2.0)


def test_world_y_is_up_and_x_right_on_paper_to_one_scale():
    plan = plan_around(np.array([[0.0, 0.0], [40.0, 10.0]]))
    left, right, above = plan.on_paper(np.array([[0.0, 0.0], [10.0, 0.0], [0.0, 10.0]]))
    assert right[0] - left[0] == pytest.approx(10 * plan.px_per_m)
    assert left[1] - above[1] == pytest.approx(10 * plan.px_per_m)


def test_the_drawing_has_both_views_people_the_camera_and_a_scale():
    moved = CameraPose(height_m=10.0, tilt_rad=math.radians(50), x_m=3.0, y_m=-2.0)
    walk = np.stack([np.full(9, 3.0), np.linspace(4, 12, 9)], axis=-1)
    uv, _ = pixel_from_ground(LENS, moved.rotation, moved.centre_m, walk)
    svg = str(
        ground_plan_svg(
            LENS,
            [Overlay(pose=POSE, kind="prior"), Overlay(pose=moved, kind="served")],
            [uv],
            misplacements(LENS, moved, POSE, [10.0]),
            label='A & "B"',
        )
    )
    assert svg.count('class="view prior"') == svg.count('class="view served"') == 1
    assert 'class="off"' in svg
    assert "A &amp; &#34;B&#34;" in svg
    (track,) = re.findall(r'class="track" d="M([\d.]+) ([\d.]+)L([\d.]+) ([\d.]+)"', svg)
    x, y, to_x, to_y = map(float, track)
    assert x == pytest.approx(to_x, abs=0.2)  # due north, as they walked
    assert to_y < y
    camera = re.search(r'class="camera" transform="translate\(([\d.]+) ([\d.]+)\)', svg)
    assert float(camera[1]) == pytest.approx(x, abs=0.2)
    bar = re.search(r"H([\d.]+)V[\d.]+\"/><text[^>]*>([\d.]+) m<", svg)
    px_per_m = (float(bar[1]) - 12) / float(bar[2])
    assert (y - to_y) / px_per_m == pytest.approx(8.0, rel=0.01)


def test_without_anybody_there_is_the_view_of_the_prior_pose():
    svg = str(ground_plan_svg(LENS, [Overlay(pose=POSE, kind="prior")], [], label="x"))
    assert 'class="view prior"' in svg
    assert "served" not in svg
    assert "nan" not in svg
