from dataclasses import replace
from math import atan, cos, log, radians, sin

import numpy as np
from hypothesis import given
from numpy.testing import assert_allclose

from models.geometry.pose import CameraPose
from studies.base_model.offsets import moved_by, offset_between
from tests.strategies import poses


def test_a_tilt_leans_ahead_and_a_roll_to_the_right(pose: CameraPose):
    level = replace(pose, roll_rad=0.0)
    lower = replace(level, tilt_rad=level.tilt_rad + radians(3), height_m=1.1 * level.height_m)
    assert_allclose(offset_between(level, lower), [radians(3), 0.0, log(1.1)], atol=1e-12)
    # A roll r at a tilt a puts the zenith at -sin r cos a to the right, cos r cos^2 a + sin^2 a up.
    rolled, r, a = replace(level, roll_rad=radians(4)), radians(4), radians(22)
    lean = atan(sin(r) * cos(a) / (cos(r) * cos(a) ** 2 + sin(a) ** 2))
    assert_allclose(offset_between(level, rolled)[1], lean, atol=1e-12)
    assert lean > 0


@given(poses())
def test_a_move_and_its_offset_are_one(pose: CameraPose):
    for offset in ([0.1, -0.2, 0.3], [-0.25, 0.05, -0.4], [0.0, 0.0, 0.0]):
        moved = moved_by(pose, np.array(offset))
        assert_allclose(offset_between(pose, moved), offset, atol=1e-6)
        assert (moved.x_m, moved.y_m, moved.heading_rad) == (pose.x_m, pose.y_m, pose.heading_rad)


def test_rays_are_levelled(pose: CameraPose):
    ahead = pose.level_from_camera @ np.array([0.0, 0.0, 1.0])
    assert_allclose(ahead, [0.0, cos(radians(22)), -sin(radians(22))], atol=1e-12)
