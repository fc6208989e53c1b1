import math

import numpy as np
import pytest

from models.errors import DegenerateGeometryError
from models.geometry.ground import ground_from_pixel
from studies.simulation.cameras import CameraRange, draw_camera


def test_cameras_are_of_their_ranges_and_see_ground():
    ranges, rng = CameraRange(), np.random.default_rng(0)
    drawn = [draw_camera(ranges, rng) for _ in range(200)]
    heights = np.array([pose.height_m for _, pose in drawn])
    assert ranges.height_m[0] <= heights.min() < 2.5
    assert 11 < heights.max() <= ranges.height_m[1]
    wide = [math.degrees(2 * math.atan(lens.width / 2 / lens.fx)) for lens, _ in drawn]
    assert 30 <= min(wide) < 40
    assert 90 < max(wide) <= 100
    for lens, pose in drawn:
        below = np.array([[lens.cx, lens.height - 1.0]])
        _, hits = ground_from_pixel(lens, pose.rotation, pose.centre_m, below)
        assert hits.all()


def test_the_seed_draws_the_camera():
    one, other = (draw_camera(CameraRange(), np.random.default_rng(4)) for _ in range(2))
    assert one == other
    assert draw_camera(CameraRange(), np.random.default_rng(5)) != one


def test_cameras_that_look_up_are_refused():
    with pytest.raises(DegenerateGeometryError, match="none of 100 draws sees enough ground"):
        draw_camera(CameraRange(tilt_rad=(-1.2, -1.0)), np.random.default_rng(0))
