"""The pose of a camera of which the lens is known and nothing else."""

import math
from dataclasses import replace

import numpy as np
import pytest

from models.errors import TooFewTrajectoriesError
from models.geometry.pose import CameraPose, plane_parameters_of
from models.pose import self_calibrate
from models.simulation.walkers import WalkConfig
from models.tracks.trajectory import by_end
from studies.simulation.lanes import SiteConfig, draw_lanes, walk_site

POSE = CameraPose(height_m=3.1, tilt_rad=math.radians(31), roll_rad=math.radians(-2))
WALK = WalkConfig()


def people(lens, pose=POSE, count=120, seed=1, **changes):
    site = SiteConfig(speed_mean_mps=1.4, standing_share=0.3, **changes)
    rng = np.random.default_rng(seed)
    return by_end(walk_site(lens, pose, draw_lanes(lens, pose, site, rng), site, count, rng))


def points(tracks):
    return [replace(track, top_v=None) for track in tracks]


@pytest.mark.parametrize("boxes", [True, False])
def test_people_tell_the_pose_within_its_interval(lens, boxes):
    seen = people(lens)
    found = self_calibrate(seen if boxes else points(seen), lens, WALK, {})
    error = found.values - plane_parameters_of(POSE)
    sd = np.sqrt(np.diag(found.covariance))
    assert found.identifiable == ("tilt", "roll", "height")
    assert (np.abs(error) <= 2 * sd).all()
    assert np.degrees(np.abs(error[:2])).max() < 1.0
    # How fast people walk is known to 15 %, how tall they are to 6 %.
    assert sd[2] == pytest.approx(0.12 if boxes else 0.25, abs=0.06)


def test_a_tape_makes_the_height_known_and_a_slow_site_no_other_tilt(lens):
    """People at 1.0 m/s for 1.4: by pace alone the camera hangs 40 % too high."""
    slow = points(people(lens, between_sd=0.1))
    slow = [replace(track, time_s=track.time_s * 1.4) for track in slow]
    by_pace = self_calibrate(slow, lens, WALK, {})
    by_tape = self_calibrate(slow, lens, WALK, {"height_m": POSE.height_m})
    assert by_pace.pose.height_m > 1.15 * POSE.height_m
    assert by_tape.pose.height_m == pytest.approx(POSE.height_m, rel=0.1)
    for found in (by_pace, by_tape):
        assert found.pose.tilt_rad == pytest.approx(POSE.tilt_rad, abs=math.radians(1.0))


@pytest.mark.parametrize("boxes", [True, False])
@pytest.mark.parametrize(
    ("measured", "tilt_deg", "roll_deg", "height"),
    [
        (["height_m"], 1.0, 1.0, 0.05),
        (["tilt_rad"], 0.71, 1.0, None),  # 1 deg by a sensor and 1 deg by tracks: 1 / sqrt 2
        (["roll_rad"], 1.0, 0.71, None),
        (["height_m", "roll_rad"], 1.0, 0.71, 0.05),
    ],
)
def test_measurement_has_its_own_sd(lens, boxes, measured, tilt_deg, roll_deg, height):
    seen = people(lens)
    given = {name: getattr(POSE, name) for name in measured}
    found = self_calibrate(seen if boxes else points(seen), lens, WALK, given)
    sd = np.sqrt(np.diag(found.covariance))
    assert np.degrees(sd[:2]) == pytest.approx([tilt_deg, roll_deg], rel=0.04)
    assert sd[2] <= height if height else sd[2] > 0.12
    assert (np.abs(found.values - plane_parameters_of(POSE)) <= 2 * sd).all()


def test_wrong_measurement_is_weighed_with_the_tracks(lens):
    """Boxes know the height to 14 %, a tape to 5 %: an error of the tape shrinks by some 12 %."""
    found = self_calibrate(people(lens), lens, WALK, {"height_m": 1.1 * POSE.height_m})
    error = found.values[2] - math.log(POSE.height_m)
    assert 0.75 * math.log(1.1) < error < 0.95 * math.log(1.1)


def test_people_who_walk_one_way_tell_the_pose_with_a_measured_angle(lens):
    seen = points(people(lens, lanes=1, aside_m=0.3))
    found = self_calibrate(seen, lens, WALK, {"tilt_rad": POSE.tilt_rad})
    sd = np.sqrt(np.diag(found.covariance))
    assert found.identifiable == ("tilt", "roll", "height")
    assert (np.abs(found.values - plane_parameters_of(POSE)) <= 2 * sd).all()


def test_who_all_walk_one_way_tell_no_pose_by_their_speeds(lens):
    found = self_calibrate(points(people(lens, lanes=1, aside_m=0.3)), lens, WALK, {})
    assert found.identifiable == ()


def test_of_few_groups_nothing_is_known(lens):
    assert self_calibrate(people(lens, count=5), lens, WALK, {}).identifiable == ()
    with pytest.raises(TooFewTrajectoriesError):
        self_calibrate(people(lens, count=3), lens, WALK, {})
