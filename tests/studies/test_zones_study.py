"""Zones after a knock: corners come back within the ellipse that is told."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from models.simulation.poses import PoseOffset
from studies.protocol.zones_study import _squared, corner_errors
from tests.conftest import SCENES


def test_an_error_along_an_ellipse_counts_less_than_one_across():
    ellipses = np.array([[2.0, 1.0, np.pi / 2]] * 2)
    assert_allclose(_squared(np.array([[0.0, 2.0], [2.0, 0.0]]), ellipses), [1.0, 4.0])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "is_open"),
    [("pets2009_s1l2_1_v001", True), ("pets2009_s2l1_v001_sort", True), ("wildtrack_c1", False)],
)
def test_corners_after_a_turn_are_followed_or_declared(scene, is_open):
    tilt, roll, heading = np.radians((3, -2, 3))
    offset = PoseOffset(tilt_rad=tilt, roll_rad=roll, log_height=0.0, heading_rad=heading)
    errors = corner_errors(SCENES / scene, 0, "still", by_time=False, offset=offset)
    assert {each.open for each in errors} == {is_open}
    assert max(each.sds for each in errors) < 1.645
    median = np.median([each.share for each in errors])
    assert median > 0.05 if is_open else median < 0.01


@pytest.mark.slow
def test_corners_come_back_on_a_recorded_scene():
    errors = corner_errors(SCENES / "wildtrack_c1", 0, "knock", by_time=False)
    assert len(errors) > 8
    assert np.median([each.share for each in errors]) < 0.01
    assert np.mean([each.squared <= 5.991 for each in errors]) > 0.9
