"""Who the tracks are of: walkers, standing people, wheels; and which feet are left out."""

import math
from dataclasses import replace

import numpy as np
import pytest

from models.estimation.joint.observations import check_in_time, observe
from models.evaluation.scenes import Knock
from models.people.feet import at_border
from models.people.kinds import KINDS, Kind
from models.people.people import see_people
from models.people.said import reason_of_people
from models.reasons import TracksCode
from models.recalibration import observe as observe_walkers
from models.trajectory import Trajectory
from tests.models.people.test_linking import START_M, walk
from tests.models.sites import KNOCKED, LENS, PRIOR, in_time, tracks_of

TURNED = Knock(tilt_rad=math.radians(-6), roll_rad=math.radians(7), log_height=-0.15).apply(PRIOR)


def street(seed, pose=PRIOR, boxes=False):
    (walked,) = tracks_of(seed, (pose, 80), boxes=boxes)
    return in_time(walked)


def faster(track, factor):
    first_s = track.time_s[0]
    return replace(track, time_s=first_s + (track.time_s - first_s) / factor)


def kinds(people):
    return {kind: people.count(kind) for kind in Kind}


@pytest.mark.parametrize("pose", [PRIOR, KNOCKED, TURNED])
def test_those_who_ride_are_told_from_those_who_walk(pose):
    walked = street(3, pose)
    ride = set(range(0, len(walked), 5))
    tracks = [faster(t, 3.2) if n in ride else t for n, t in enumerate(walked)]
    people = see_people(in_time(tracks), LENS, PRIOR).people
    found = kinds(people)
    unmixed = kinds(see_people(walked, LENS, PRIOR).people)
    assert unmixed[Kind.WHEELS] + unmixed[Kind.OTHER] <= 2
    # Some ride past in less than a step.
    asked = len(ride) - (found[Kind.UNSEEN] - unmixed[Kind.UNSEEN])
    assert found[Kind.WHEELS] >= 0.85 * asked
    assert found[Kind.WALKER] >= 0.95 * (unmixed[Kind.WALKER] - len(ride))


def test_who_rides_has_no_steps_and_who_stands_keeps_his_box():
    walked = street(4)
    stands = walk(0, 40, velocity=[0.0, 0.02])
    tracks = in_time([*walked[:40], *(faster(t, 3.5) for t in walked[40:50]), stands])
    seen = see_people(tracks, LENS, PRIOR)
    at = next(n for n, track in enumerate(tracks) if track is stands)
    assert KINDS[seen.people.kind_idx[at]] is Kind.STANDING
    assert at in seen.observations.steps.rows.owner_idx
    assert seen.people.count(Kind.WHEELS) >= 6  # of ten, of whom some stand
    riding = np.flatnonzero(seen.people.kind_idx == KINDS.index(Kind.WHEELS))
    assert not np.isin(riding, seen.observations.steps.rows.owner_idx).any()
    asked = sum(seen.people.count(kind) for kind in (Kind.WALKER, Kind.STANDING))
    assert seen.observations.walkers == asked


def test_pieces_count_once_with_their_last():
    pieces = [walk(0, 4), walk(5, 9), walk(0, 9.5, start=START_M + [0.0, 6.0]), walk(10, 14)]
    seen = see_people(pieces, LENS, PRIOR)
    assert seen.people.walk_idx.tolist() == [3, 3, 2, 3]
    assert (seen.people.linked, seen.people.count(Kind.WALKER)) == (2, 2)
    assert np.unique(seen.observations.steps.rows.owner_idx).tolist() == [2, 3]
    assert (seen.observations.tracks, seen.observations.ended_s.tolist()) == (
        4,
        [piece.time_s[-1] for piece in pieces],
    )
    check_in_time(seen.observations)
    one = see_people([pieces[2], walk(0, 14)], LENS, PRIOR).observations
    assert len(one.steps.rows) >= len(seen.observations.steps.rows) > len(one.steps.rows) - 3


def test_all_is_as_it_was_where_nothing_is_wrong():
    walked = street(5)
    tracks = [track for track in walked if not any(at_border([track], LENS, PRIOR)[0])]
    seen = see_people(tracks, LENS, PRIOR)
    if seen.people.count(Kind.WALKER) == len(tracks):
        whole = observe(tracks, LENS)
        np.testing.assert_array_equal(seen.observations.steps.start_rays, whole.steps.start_rays)
    assert seen.people.count(Kind.WALKER) >= 0.95 * len(tracks)


def test_points_at_the_border_are_left_out():
    uv = np.array([[600, 500], [600, 717.5], [600, 719], [3, 500], [1276, 500], [60, 500]], float)
    track = Trajectory(time_s=np.arange(6.0), uv=uv)
    # At v = 500 a metre is 1100 (sin 18 + 140.5 / 1100 cos 18) / 6 = 79 px, 0.3 m are 24.
    assert at_border([track], LENS, PRIOR)[0].tolist() == [False, True, True, True, True, False]


def test_a_track_that_leaves_at_the_border_keeps_its_end():
    down = walk(0, 12, start=[0.0, 16.0], velocity=[0.0, -1.2])
    stuck = replace(down, uv=np.minimum(down.uv, [1e9, 719.0]))
    seen = see_people([stuck], LENS, PRIOR)
    assert seen.observations.ended_s.tolist() == [stuck.time_s[-1]]
    speeds = seen.observations.steps
    assert speeds.rows.time_s.max() < stuck.time_s[stuck.uv[:, 1] >= 717][0]


def test_steps_behind_a_hedge_are_left_out():
    walked = street(6, boxes=True)
    clean = see_people(walked, LENS, PRIOR)
    assert clean.people.hidden_steps <= 0.02 * len(clean.observations.steps.rows)
    behind = []
    for track in walked[::4]:
        assert track.top_v is not None
        later = track.time_s > track.time_s[0] + 4
        uv = track.uv.copy()
        uv[later, 1] -= 0.3 * np.nan_to_num(uv[later, 1] - track.top_v[later])
        behind.append(replace(track, uv=uv))
    tracks = in_time([*behind, *(t for n, t in enumerate(walked) if n % 4)])
    hidden = see_people(tracks, LENS, PRIOR)
    wrong = sum(max(0.0, track.duration_s - 4) for track in behind) / 1.5
    assert hidden.people.hidden_steps > 0.6 * wrong


def test_the_same_tracks_give_the_same():
    tracks = street(7)
    one, other = (observe_walkers(tracks, LENS, PRIOR) for _ in range(2))
    np.testing.assert_array_equal(one.steps.start_rays, other.steps.start_rays)


def test_no_tracks_at_all():
    seen = see_people([], LENS, PRIOR)
    assert (seen.observations.tracks, seen.people.linked) == (0, 0)
    assert reason_of_people(seen.people) is None


def test_pieces_are_told_of_and_a_clean_street_is_not():
    assert reason_of_people(see_people(street(8), LENS, PRIOR).people) is None
    reason = reason_of_people(see_people([walk(0, 4), walk(5, 9)], LENS, PRIOR).people)
    assert reason is not None
    assert reason.code is TracksCode.NOT_ALL_WALKERS
    assert (reason.values["tracks"], reason.values["linked"], reason.values["walker"]) == (2, 1, 1)
