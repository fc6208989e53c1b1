"""Who is before and who after: in time, at night, at random, and how many."""

from dataclasses import replace

import numpy as np
import pytest

from models.geometry.ground import pixel_from_ground
from models.tracks.scenes import Scene, SceneTrack
from models.tracks.trajectory import Trajectory
from studies.faults.catalogue import FAULTS
from studies.protocol.cases import PANNED, RANGES, STILL, draw_case
from studies.protocol.partings import (
    HALVES_IN_TIME,
    HALVES_OF_PEOPLE,
    Parting,
    Split,
    part_people,
)
from tests.models.sites import LENS, PRIOR

HOUR_S = 3600.0


def scene_of(starts_s, *, people=None, beyond=False) -> Scene:
    """Somebody at each time who walks 12 m across the picture in 10 s, from -6 to 6 m."""
    across = np.linspace(-6, 6, 26)
    ground = np.stack([across, np.full(26, 18.0)], axis=1)
    uv, _ = pixel_from_ground(LENS, PRIOR.rotation, PRIOR.centre_m, ground)
    tracks = [
        SceneTrack(
            track_id=str(n),
            trajectory=Trajectory(time_s=start + 0.4 * np.arange(26), uv=uv),
            person_id=str(n if people is None else people[n]),
        )
        for n, start in enumerate(starts_s)
    ]
    return Scene(
        scene_id="made-up",
        intrinsics=LENS,
        true_pose=PRIOR,
        frame_rate_hz=2.5,
        tracks=tuple(tracks),
        beyond_picture=beyond,
    )


def ids(tracks):
    return [int(track.track_id) for track in tracks]


def test_the_earlier_half_is_before_the_later():
    parts = part_people(scene_of(30.0 * np.arange(20)), HALVES_IN_TIME, np.random.default_rng(3))
    assert ids(parts.reference) == list(range(10))
    assert ids(parts.later) == list(range(10, 20))


def test_who_came_early_and_again_is_of_the_earlier_half():
    people = [*range(9), 3]  # the last track is the fourth person's
    parts = part_people(
        scene_of(30.0 * np.arange(10), people=people), HALVES_IN_TIME, np.random.default_rng(0)
    )
    assert ids(parts.reference) == [0, 1, 2, 3, 9]


def test_a_recording_of_days_is_parted_at_the_night_nearest_to_its_middle():
    days = [0, 0, 0, 24, 24, 24, 24, 48, 48, 48]
    starts = [HOUR_S * day + 60 * n for n, day in enumerate(days)]
    parts = part_people(scene_of(starts), HALVES_IN_TIME, np.random.default_rng(0))
    assert ids(parts.reference) == [0, 1, 2]  # 3 and 7 people before a night; 5 are the middle
    noon = [0, 1, 2, 3, 4 + 3 * 3600, 5 + 3 * 3600]  # three quiet hours are no night
    parts = part_people(scene_of(noon), HALVES_IN_TIME, np.random.default_rng(0))
    assert ids(parts.reference) == [0, 1, 2]


def test_a_knock_is_the_same_however_people_are_parted():
    scene = scene_of(30.0 * np.arange(40))
    halves = [draw_case(scene, 4, PANNED, split) for split in (HALVES_OF_PEOPLE, HALVES_IN_TIME)]
    assert halves[0].true_pose == halves[1].true_pose
    in_time = halves[1]
    ended = max(float(track.time_s[-1]) for track in in_time.reference)
    assert all(track.time_s[0] > ended for track in in_time.seen)


@pytest.mark.parametrize(
    ("name", "moved"),
    [
        ("tilt-alone", "tilt_rad"),
        ("roll-alone", "roll_rad"),
        ("pan-alone", "heading_rad"),
        ("height-alone", "height_m"),
    ],
)
def test_a_number_alone_moves_nothing_else(name, moved):
    case = draw_case(scene_of(30.0 * np.arange(6)), 1, RANGES[name], HALVES_IN_TIME)
    every = ("tilt_rad", "roll_rad", "heading_rad", "height_m", "x_m", "y_m")
    differs = [n for n in every if getattr(case.true_pose, n) != getattr(PRIOR, n)]
    assert differs == [moved]


def test_so_many_are_the_reference_and_so_many_after_one_another_are_seen():
    scene = scene_of(30.0 * np.arange(100))
    parting = Parting(split=Split.TIME, reference_tracks=20, seen_tracks=10)
    begun = set()
    for seed in range(12):
        case = draw_case(scene, seed, STILL, parting)
        assert [t.time_s[0] for t in case.reference] == [30.0 * n for n in range(20)]
        first = case.seen[0].time_s[0]
        assert [t.time_s[0] for t in case.seen] == [first + 30.0 * n for n in range(10)]
        assert first >= 30.0 * 50
        begun.add(first)
    assert len(begun) > 6  # drawn moments


def test_who_was_followed_beyond_the_picture_is_seen_only_inside_it():
    ground = np.stack([np.linspace(-20, 20, 101), np.full(101, 18.0)], axis=1)
    uv, _ = pixel_from_ground(LENS, PRIOR.rotation, PRIOR.centre_m, ground)
    wide = SceneTrack(
        track_id="w",
        trajectory=Trajectory(time_s=0.4 * np.arange(101), uv=uv),
        person_id="w",
    )
    scene = scene_of([100.0], beyond=True)
    scene = replace(scene, tracks=(wide, *scene.tracks))
    case = draw_case(scene, 0, STILL, HALVES_IN_TIME)
    (seen,) = case.reference
    assert 40 < seen.time_s.size < 70
    assert LENS.contains(seen.uv).all()


def test_a_fault_is_of_the_reference_too_unless_it_sets_in_later():
    scene = scene_of(30.0 * np.arange(20))
    plain = draw_case(scene, 2, STILL, HALVES_IN_TIME)
    always = draw_case(scene, 2, STILL, HALVES_IN_TIME, FAULTS["fragments"])
    later = draw_case(scene, 2, STILL, HALVES_IN_TIME, FAULTS["fragments-later"])
    assert len(plain.reference) == len(later.reference) == 10
    assert len(always.reference) > 15
    assert len(later.seen) == len(always.seen) > 15
    assert max(track.duration_s for track in later.seen) <= 4.0
