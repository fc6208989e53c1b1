"""When a camera moved: simulated streets whose camera is knocked at a known time."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

from models.geometry.pose import array_of
from models.pose import estimate_pose, learn_site, observe, with_time_of_move
from models.pose.config import FEWEST_BESIDE
from models.pose.move_time import moved_between
from models.simulation.poses import offset_trajectory
from models.tracks.trajectory import Trajectory
from studies.simulation.lanes import draw_lanes, walk_site
from tests.service.street import LANES, LENS, PRIOR

START_S = 1e6


@dataclass(frozen=True)
class Knock:
    """A move by up to so many degrees, after `before` people who come `gap_s` apart."""

    size_deg: float
    before: int
    gap_s: float
    seed: int


@pytest.fixture(scope="module")
def lanes():
    return draw_lanes(LENS, PRIOR, LANES, np.random.default_rng(3))


@pytest.fixture(scope="module")
def site(lanes):
    tracks = walk_site(LENS, PRIOR, lanes, LANES, 150, np.random.default_rng(1))
    tracks = [ending_at(track, 5.0 * number) for number, track in enumerate(tracks)]
    return learn_site(observe(tracks, LENS, PRIOR), LENS, PRIOR)


def ending_at(track, end_s):
    return replace(track, time_s=track.time_s - track.time_s[-1] + end_s)


def street_of(lanes, knock, after):
    """Tracks in the order of their ends, and when the camera moved: whoever is in view is cut."""
    rng = np.random.default_rng(knock.seed)
    way = rng.normal(0, 1, 3)
    tilt, roll, heading = np.radians(knock.size_deg * way / np.abs(way).max() * (0.7, 0.5, 1.0))
    moved = replace(
        PRIOR,
        tilt_rad=PRIOR.tilt_rad + tilt,
        roll_rad=PRIOR.roll_rad + roll,
        heading_rad=PRIOR.heading_rad + heading,
    )
    moved_s = START_S + knock.gap_s * (knock.before + rng.uniform(0, 1))
    tracks = []
    people = walk_site(LENS, PRIOR, lanes, LANES, knock.before + after + 8, rng)
    for number, walk in enumerate(people):
        track = ending_at(walk, START_S + knock.gap_s * (number + 1))
        early = track.time_s <= moved_s
        for part, seen in ((early, lambda each: each), (~early, knocked_by(moved))):
            if part.sum() > 1:
                tracks.append(seen(Trajectory(time_s=track.time_s[part], uv=track.uv[part])))
    tracks = [each for each in tracks if each is not None and long_enough(each.time_s)]
    tracks.sort(key=lambda each: each.time_s[-1])
    before = sum(each.time_s[-1] <= moved_s for each in tracks)
    return tracks[: before + after], moved_s, moved


def knocked_by(moved):
    return lambda track: offset_trajectory(track, LENS, PRIOR, moved)


def long_enough(time_s):
    return len(time_s) >= 5 and time_s[-1] - time_s[0] >= 2


def times_of(tracks, between):
    """As `Evidence.times_of`, in seconds: of tracks without a service."""
    first, last = between.first, between.last
    before_s = tracks[last].time_s[0]
    if last:
        before_s = max(before_s, tracks[last - 1].time_s[-1])
    if not first:
        return -math.inf, before_s
    return min(tracks[first - 1].time_s[-1], tracks[first].time_s[0]), before_s


def reported(site, tracks):
    """The times between which the camera is reported to have moved; None if there are none."""
    observed = observe(tracks, LENS, PRIOR)
    found = with_time_of_move(estimate_pose(observed, site), observed, site)
    return None if found.between is None else times_of(tracks, found.between)


@pytest.mark.parametrize(
    ("knock", "widest_s"),
    [
        (Knock(12.0, 15, 15.0, 1), 60),
        (Knock(6.0, 60, 5.0, 2), 60),
        (Knock(6.0, 4, 40.0, 5), math.inf),
    ],
)
def test_the_move_is_between_the_times_reported(lanes, site, knock, widest_s):
    tracks, moved_s, _ = street_of(lanes, knock, 30)
    after_s, before_s = reported(site, tracks)
    assert after_s <= moved_s <= before_s
    assert before_s - after_s < widest_s


def test_no_time_is_reported_with_fewer_than_12_people_after_the_move(lanes, site):
    knock = Knock(12.0, 25, 40.0, 3)
    for after in (6, FEWEST_BESIDE - 2):
        tracks, _, moved = street_of(lanes, knock, after)
        observed = observe(tracks, LENS, PRIOR)
        assert moved_between(observed, site, array_of(PRIOR), array_of(moved)) is None
        assert reported(site, tracks) is None


def test_a_move_before_all_tracks_has_no_first_track(lanes, site):
    """At both poses as they are: all tracks are from after the move."""
    tracks, moved_s, moved = street_of(lanes, Knock(6.0, 20, 15.0, 4), 30)
    later = [track for track in tracks if track.time_s[0] >= moved_s]
    observed = observe(later, LENS, PRIOR)
    found = moved_between(observed, site, array_of(PRIOR), array_of(moved))
    assert found.first == 0
    assert found.last <= 1


@pytest.mark.slow
def test_the_interval_holds_nine_of_ten_moves(lanes, site):
    """Of 40 moves of 1.5 to 12 deg, after 4 to 60 people who come 5 to 40 s apart."""
    held, widths = [], []
    for seed in range(40):
        rng = np.random.default_rng(100 + seed)
        knock = Knock(
            size_deg=float(rng.choice([1.5, 3, 6, 12])),
            before=int(rng.choice([4, 8, 14, 25, 60])),
            gap_s=float(rng.choice([5, 15, 40])),
            seed=seed,
        )
        tracks, moved_s, _ = street_of(lanes, knock, 30)
        times = reported(site, tracks)
        if times is not None:
            held.append(times[0] <= moved_s <= times[1])
            widths.append(times[1] - times[0])
    assert len(held) >= 20
    assert np.mean(held) >= 0.9
    assert np.median(widths) < 100
