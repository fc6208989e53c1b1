from dataclasses import replace
from math import degrees, radians

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from models.geometry.intrinsics import Intrinsics
from models.pictures.features import describe
from models.pictures.matching import lens_of
from models.pictures.turn import turn_between, turned_covariance, turned_pose
from tests.models.pictures.given import LENS, PRIOR, seen_after, wall


def turned(grey=None, *, zoom=1.0, **by_deg):
    grey = wall() if grey is None else grey
    moved = {
        f"{name}_rad": getattr(PRIOR, f"{name}_rad") + radians(by) for name, by in by_deg.items()
    }
    after = replace(PRIOR, **moved)
    return after, seen_after(grey, PRIOR, after, zoom=zoom)


@pytest.mark.parametrize(
    "by",
    [{}, {"tilt": 4.0}, {"roll": -3.0}, {"heading": 6.0}, {"tilt": -2, "roll": 5, "heading": -9}],
)
def test_a_turn_is_found_with_the_signs_of_the_house(by):
    after, picture = turned(**by)
    turn = turn_between(describe(wall()), describe(picture), LENS)
    found = turned_pose(PRIOR, turn)
    assert_allclose(
        [found.tilt_rad, found.roll_rad, found.heading_rad],
        [after.tilt_rad, after.roll_rad, after.heading_rad],
        atol=radians(0.05),
    )
    assert found.height_m == PRIOR.height_m
    assert not turn.shifted


def test_the_aim_is_right_down_and_clockwise_of_a_level_camera():
    level = replace(PRIOR, tilt_rad=0.0, roll_rad=0.0)
    after = replace(
        level,
        tilt_rad=radians(2.0),
        roll_rad=radians(1.0),
        heading_rad=level.heading_rad + radians(3.0),
    )
    turn = turn_between(describe(wall()), describe(seen_after(wall(), level, after)), LENS)
    assert_allclose(np.degrees(turn.aim), [3.0, 2.0, 1.0], atol=0.1)


def test_the_covariance_of_the_angles_is_that_of_the_turn_carried_over():
    """Of a camera that looks down by 60 deg, a turn about the vertical is half a turn in its view.

    A turn about down (the camera's y) by d changes the heading by d / cos(60) = 2 d; about right it
    is tilt alone.
    """
    after, picture = turned()
    turn = turn_between(describe(wall()), describe(picture), LENS)
    steep = replace(PRIOR, tilt_rad=radians(60.0), roll_rad=0.0)
    plain = replace(turn, rotation=np.zeros(3), covariance=np.diag([1.0, 4.0, 9.0, 1.0]) * 1e-6)
    found = turned_covariance(steep, plain)
    # Tilt: about right, sd 1. Heading: 2 / cos 60 = 4. Roll: forward's 3, and 2 tan 60 of the turn
    # about down: variance 9 + 12.
    assert_allclose(np.diag(found), [1e-6, 21e-6, 16e-6], rtol=1e-6)


def test_a_zoom_is_told_from_a_turn():
    _, picture = turned(zoom=1.3, heading=2.0)
    turn = turn_between(describe(wall()), describe(picture), LENS)
    assert np.exp(turn.log_zoom) == pytest.approx(1.3, abs=0.01)
    assert degrees(turned_pose(PRIOR, turn).heading_rad) == pytest.approx(42.0, abs=0.1)


def test_a_picture_of_another_size_is_the_same_view():
    _, picture = turned(heading=3.0)
    half = cv2.resize(picture, (480, 270), interpolation=cv2.INTER_AREA)
    turn = turn_between(describe(wall()), describe(half), LENS)
    assert degrees(turned_pose(PRIOR, turn).heading_rad) == pytest.approx(43.0, abs=0.1)
    assert turn.log_zoom == pytest.approx(0.0, abs=0.005)


def test_a_lens_is_scaled_and_cut_about_its_middle():
    wide = Intrinsics(width=1280, height=720, fx=1000, fy=1000, cx=659.5, cy=359.5)
    cut = lens_of(wide, 480, 360)
    # Half as large, cut from 640 to 480: 20 px right of the middle are 10.
    assert (cut.fx, cut.cx, cut.cy) == (500, 239.5 + 10, 179.5)
    fisheye = replace(wide, projection="fisheye", distortion=(0.1, 0.01, 0.0, 0.0))
    assert lens_of(fisheye, 640, 360).rays(np.array([[639.5, 359.5]]))[0] == pytest.approx(
        fisheye.rays(np.array([[1279.5, 719.5]]))[0], rel=1e-3
    )


def test_nothing_in_common_is_no_turn():
    assert turn_between(describe(wall(0)), describe(wall(1)), LENS) is None
    empty = describe(np.full((360, 640), 80, np.uint8))
    assert turn_between(describe(wall()), empty, LENS) is None
    assert turn_between(empty, empty, LENS) is None


def written(grey):
    """A picture with a clock and a name, as cameras write them."""
    grey = grey.copy()
    for place, text in (((8, 20), "2026-11-25 14:03:59"), ((400, 350), "CAMERA 04 GATE")):
        cv2.putText(grey, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.7, 255, 2)
        cv2.putText(grey, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.7, 0, 1)
    return grey


def test_a_clock_on_the_screen_is_no_anchor():
    _, picture = turned(heading=5.0)
    turn = turn_between(describe(written(wall())), describe(written(picture)), LENS)
    assert degrees(turned_pose(PRIOR, turn).heading_rad) == pytest.approx(45.0, abs=0.05)


def test_a_clock_alone_does_not_say_that_a_camera_stands():
    plain = np.full((360, 640), 80, np.uint8)
    assert turn_between(describe(written(plain)), describe(written(plain)), LENS) is None
    assert turn_between(describe(written(wall(0))), describe(written(wall(1))), LENS) is None


def driven(width, by):
    """A picture with something large in it, before and after it moved aside."""
    lorry = wall(7)[:, :width]
    pictures = wall(), wall()
    for picture, at in zip(pictures, (60, 60 + by), strict=True):
        picture[:, at : at + width] = lorry
    return [describe(picture) for picture in pictures]


def test_a_lorry_before_a_third_of_the_view_turns_nothing():
    turn = turn_between(*driven(215, 60), LENS)
    assert degrees(turn.angle_rad) < 0.05
    assert not turn.shifted


@pytest.mark.parametrize("width", [320, 450])
def test_a_bus_before_most_of_the_view_is_no_turn(width):
    turn = turn_between(*driven(width, 60), LENS)
    assert turn is None or degrees(turn.angle_rad) < 0.05


def test_a_car_that_is_all_that_matches_is_no_turn():
    """The rest of the view is in such a light that nothing of it is found again."""
    before, after = wall(0), wall(1)
    for picture, at in ((before, 60), (after, 130)):
        picture[100:220, at : at + 180] = wall(7)[100:220, :180]
    assert turn_between(describe(before), describe(after), LENS) is None


def test_a_mask_that_hides_a_window_is_no_anchor():
    _, picture = turned(heading=5.0)
    before = wall()
    for each in (before, picture):
        each[120:220, 200:420] = 0
    turn = turn_between(describe(before), describe(picture), LENS)
    assert degrees(turned_pose(PRIOR, turn).heading_rad) == pytest.approx(45.0, abs=0.05)


def test_a_camera_that_moved_aside_is_told_and_less_sure():
    """Far things, above, stay; near ones, below, are 12 px aside, and so are those between."""
    grey = wall()
    rows = np.arange(360, dtype=np.float32)
    aside = 12 + np.maximum(rows - 120, 0) / 240 * 40
    u, v = np.meshgrid(np.arange(640, dtype=np.float32), rows)
    after = cv2.remap(grey, u + aside[:, None].astype(np.float32), v, cv2.INTER_LINEAR)
    turn = turn_between(describe(grey), describe(after), LENS)
    assert turn.shifted
    # It may not have turned at all: 12 px are 1.4 deg, and those below are up to 4.6 deg more.
    assert degrees(turn.angle_rad) > 1.0
    assert 0.5 < degrees(np.sqrt(turn.covariance[1, 1])) < 4.6
    only = turn_between(describe(grey), describe(turned(heading=1.4)[1]), LENS)
    assert not only.shifted
