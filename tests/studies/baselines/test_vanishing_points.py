"""Vanishing points: exact where heads are seen, wrong where they are the tops of boxes."""

import math
from dataclasses import replace

import numpy as np
import pytest

from models.errors import TooFewTrajectoriesError
from models.geometry.ground import pixel_from_ground
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import angles_from_rotation
from models.tracks.trajectory import Trajectory
from studies.baselines.vanishing_points import orientation_of_walker, tilt_and_roll, up_of_walkers
from studies.simulation.heads import HeadConfig, with_box_heads, with_heads

LENS = Intrinsics(width=1280, height=720, fx=1000, fy=1000, cx=639.5, cy=359.5)
POSE = CameraPose(
    height_m=6.0, tilt_rad=math.radians(25), roll_rad=math.radians(4), heading_rad=math.radians(30)
)
UPRIGHT = HeadConfig(jitter=0.0, person_sd_rad=0.0)


def walker(ahead_m: float, aside_m: float, way_deg: float) -> Trajectory:
    """Somebody who walks 4 m in a direction (clockwise from +Y) through a place before the camera.

    Heads of 1.7 m, right above the feet.
    """
    looks = np.array([math.sin(POSE.heading_rad), math.cos(POSE.heading_rad)])
    place = ahead_m * looks + aside_m * np.array([looks[1], -looks[0]])
    way = np.array([math.sin(math.radians(way_deg)), math.cos(math.radians(way_deg))])
    ground = place + np.linspace(-2, 2, 11)[:, None] * way
    feet, _ = pixel_from_ground(LENS, POSE.rotation, POSE.centre_m, ground)
    track = Trajectory(time_s=0.4 * np.arange(11), uv=feet)
    (seen,) = with_heads([track], LENS, POSE, UPRIGHT, np.random.default_rng(0))
    return seen


CROWD = [
    walker(ahead, aside, way)
    for number, (ahead, aside) in enumerate([(9, -2), (10, 1), (12, 3), (14, -3), (16, 0)])
    for way in (20.0 + 70 * number, 120.0 + 70 * number)
]


@pytest.mark.parametrize("way_deg", [0.0, 75.0, 200.0])
def test_one_walker_tells_the_whole_rotation_against_their_own_way(way_deg):
    found = orientation_of_walker(LENS, walker(11, 0.5, way_deg))
    tilt, roll, heading = (math.degrees(angle) for angle in angles_from_rotation(found))
    assert tilt == pytest.approx(25, abs=1e-6)
    assert roll == pytest.approx(4, abs=1e-6)
    # The camera looks at 30 deg of the world: so much clockwise of the walker's way.
    assert math.remainder(heading - (30 - way_deg), 360) == pytest.approx(0, abs=1e-6)


def test_all_walkers_tell_tilt_and_roll():
    tilt, roll = tilt_and_roll(up_of_walkers(LENS, CROWD))
    assert (math.degrees(tilt), math.degrees(roll)) == pytest.approx((25, 4), abs=1e-6)


def test_some_that_are_all_wrong_count_for_little():
    wrong = [replace(CROWD[0], head_uv=CROWD[0].head_uv + (60.0, 0.0))]
    tilt, roll = tilt_and_roll(up_of_walkers(LENS, CROWD + wrong))
    assert (math.degrees(tilt), math.degrees(roll)) == pytest.approx((25, 4), abs=0.1)


def test_tops_of_boxes_have_no_lean_and_tell_nothing():
    """Seen from above, heads lean away from the middle of the picture; tops of boxes never do."""
    boxes = with_box_heads([replace(track, top_v=track.head_uv[:, 1]) for track in CROWD])
    tilt, roll = (math.degrees(angle) for angle in tilt_and_roll(up_of_walkers(LENS, boxes)))
    assert math.hypot(tilt - 25, roll - 4) > 4


def test_who_has_no_head_or_stands_is_refused():
    blind = replace(CROWD[0], head_uv=None)
    with pytest.raises(TooFewTrajectoriesError, match="3 points with a head"):
        orientation_of_walker(LENS, blind)
    with pytest.raises(TooFewTrajectoriesError, match="3 points of one with a head"):
        up_of_walkers(LENS, [blind])
