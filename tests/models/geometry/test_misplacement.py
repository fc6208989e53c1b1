"""What a move means on the ground, against numbers worked out by hand."""

from math import radians, sin, tan

import pytest

from models.errors import ShapeError
from models.geometry.ground import misplacements
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose

LENS = Intrinsics(width=1001, height=1001, fx=500, fy=500, cx=500, cy=500)


def looks_down(tilt_deg: float, height_m: float = 10.0, **turned: float) -> CameraPose:
    return CameraPose(height_m=height_m, tilt_rad=radians(tilt_deg), x_m=3.0, y_m=-2.0, **turned)


def test_a_lower_tilt_is_believed_to_see_farther():
    (at,) = misplacements(LENS, looks_down(45), looks_down(40), [10.0])
    assert at.distance_m == 10.0
    assert at.off_m == pytest.approx(1.9175, abs=1e-4)  # 10 / tan 40 deg - 10
    assert at.farther_m == pytest.approx(1.9175, abs=1e-4)
    assert at.stands_m == pytest.approx((3.0, 8.0))  # heading 0 is along +Y
    assert at.placed_m == pytest.approx((3.0, 9.9175), abs=1e-4)


def test_the_other_way_round_people_come_nearer():
    (at,) = misplacements(LENS, looks_down(40), looks_down(45), [10 / tan(radians(40))])
    assert at.off_m == pytest.approx(1.9175, abs=1e-4)
    assert at.farther_m == pytest.approx(-1.9175, abs=1e-4)


def test_a_pan_moves_people_along_a_circle_whatever_the_tilt_and_the_heading():
    true, believed = (
        looks_down(30, heading_rad=radians(75)),
        looks_down(30, heading_rad=radians(70)),
    )
    near, far = misplacements(LENS, true, believed, [10.0, 40.0])
    assert near.off_m == pytest.approx(2 * 10 * sin(radians(2.5)))
    assert far.off_m == pytest.approx(2 * 40 * sin(radians(2.5)))  # 3.4896 m
    assert far.farther_m == pytest.approx(-40 * (1 - 0.9961947), abs=1e-4)  # cos 5 deg


def test_a_camera_that_was_raised_by_a_tenth_shrinks_the_ground_by_a_tenth():
    (at,) = misplacements(LENS, looks_down(30, 11.0), looks_down(30, 10.0), [22.0])
    assert at.off_m == pytest.approx(2.0)
    assert at.farther_m == pytest.approx(-2.0)


def test_no_move_is_no_error():
    (at,) = misplacements(LENS, looks_down(30), looks_down(30), [20.0])
    assert at.off_m == pytest.approx(0.0, abs=1e-9)


def test_distances_out_of_the_picture_are_left_out():
    # 45 deg each way of 45 deg: all but what lies behind the foot, and what lies above.
    long = Intrinsics(width=1001, height=1001, fx=5000, fy=5000, cx=500, cy=500)
    found = misplacements(long, looks_down(45), looks_down(45), [1.0, 10.0, 100.0])
    assert [at.distance_m for at in found] == [10.0]


def test_a_person_above_the_believed_horizon_is_nowhere():
    (at,) = misplacements(LENS, looks_down(30), looks_down(2), [40.0])  # seen 14 deg down: 14 up
    assert (at.off_m, at.farther_m, at.placed_m) == (None, None, None)


def test_a_distance_is_above_0():
    with pytest.raises(ShapeError, match="distances_m"):
        misplacements(LENS, looks_down(30), looks_down(30), [0.0])
