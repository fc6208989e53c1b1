"""Faults of trackers, detectors and clocks, by numbers worked out by hand."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from models.tracks.scenes import Scene
from studies.faults.boxes import box_jitter, detector_update, rounding
from studies.faults.clocks import drifting_clock, dropped_frames, jittered_clock, wrong_rate
from studies.faults.hidden_feet import (
    Thing,
    draw_things,
    hidden_feet,
    hidden_m,
    jumps,
)
from studies.faults.identities import fragments, switches
from studies.faults.view import view_of
from tests.studies.faults.sights import LENS, POSE, straight, view_on, walk

VIEW = view_on([(0, 20)])


def test_pieces_last_two_to_four_seconds_and_keep_their_person():
    one = walk("a", straight((-10, 25), (10, 25), 201))  # 20 s at 10 Hz
    pieces = fragments([one], VIEW, 3.0, 1)
    assert [piece.track_id for piece in pieces] == [f"a.{k}" for k in range(len(pieces))]
    assert {piece.person_id for piece in pieces} == {"a"}
    assert 5 <= len(pieces) <= 10  # of 2 to 4 s, up to 0.5 s between them
    for piece in pieces[:-1]:
        assert 1.8 <= piece.trajectory.duration_s <= 4.0
    for before, after in zip(pieces, pieces[1:], strict=False):
        gap_s = after.trajectory.time_s[0] - before.trajectory.time_s[-1]
        assert 0.1 - 1e-9 <= gap_s <= 0.7 + 1e-9
    at = {time: uv for time, uv in zip(one.trajectory.time_s, one.trajectory.uv, strict=True)}
    assert all(
        (at[t] == uv).all()
        for p in pieces
        for t, uv in zip(p.trajectory.time_s, p.trajectory.uv, strict=True)
    )
    other = fragments([one], VIEW, 3.0, 2)
    assert other[0].trajectory.time_s.size != pieces[0].trajectory.time_s.size  # by the seed


def test_two_who_pass_each_other_exchange_their_ids_there():
    rightwards = walk("a", straight((-5, 20), (5, 20), 101))
    leftwards = walk("b", straight((5, 20.5), (-5, 20.5), 101))
    far = walk("c", straight((-5, 40), (5, 40), 101))
    mixed = {t.track_id: t.trajectory for t in switches([rightwards, leftwards, far], VIEW, 1.0, 0)}
    # They meet at 5 s, half a metre apart: `a` goes on as who came from the right.
    met = 50
    assert_allclose(mixed["a"].uv[:met], rightwards.trajectory.uv[:met])
    assert_allclose(mixed["a"].uv[met:], leftwards.trajectory.uv[met:])
    assert_allclose(mixed["b"].uv[met:], rightwards.trajectory.uv[met:])
    assert_allclose(mixed["c"].uv, far.trajectory.uv)
    same = switches([rightwards, leftwards, far], VIEW, 0.0, 0)
    assert all(
        (a.trajectory.uv == b.trajectory.uv).all()
        for a, b in zip(same, (rightwards, leftwards, far), strict=True)
    )


def test_a_box_reaches_farther_by_a_share_of_the_person():
    # 20 m away: foot at v = 750, and 1.7 m are 85 px, of which 3 % are 2.55.
    one = walk("a", straight((-5, 20), (5, 20), 41), tall_m=1.8)
    (moved,) = detector_update([one], VIEW, 0.03, 0)
    assert_allclose(moved.trajectory.uv[:, 1], 752.55)
    assert_allclose(moved.trajectory.uv[:, 0], one.trajectory.uv[:, 0])
    assert_allclose(moved.trajectory.top_v, 500 + 1000 * 3.2 / 20 - 2.55)


def test_jitter_is_a_share_of_the_person_and_ends_at_the_border():
    one = walk("a", straight((-5, 20), (5, 20), 2001), step_s=0.01)
    (moved,) = box_jitter([one], VIEW, 0.03, 4)
    off = moved.trajectory.uv - one.trajectory.uv
    assert_allclose(off.std(axis=0), 2.55, rtol=0.06)
    assert abs(np.corrcoef(off[:-1, 1], off[1:, 1])[0, 1]) < 0.07
    near = walk("b", straight((-1, 10.01), (1, 10.01), 401))  # at v = 999.5
    (kept,) = box_jitter([near], VIEW, 0.03, 4)
    assert kept.trajectory.uv[:, 1].max() == 1000.5
    assert kept.trajectory.time_s.size == 401


def test_pixels_are_rounded_to_a_multiple():
    one = walk("a", [[0.0, 20.0], [0.5, 25.0], [0.9, 30.0]])
    (moved,) = rounding([one], VIEW, 6.0, 0)
    # (1000, 750), (1020, 700), (1030, 666.67) in sixes: 166.67, 125; 170, 116.67; 171.67, 111.1
    assert_allclose(moved.trajectory.uv, [[1002, 750], [1020, 702], [1032, 666]])


def test_a_lost_frame_lacks_everywhere():
    two = [
        walk(name, straight((-5, y), (5, y), 1001), step_s=0.01)
        for name, y in (("a", 20), ("b", 30))
    ]
    left = dropped_frames(two, VIEW, 0.3, 5)
    assert_allclose(left[0].trajectory.time_s, left[1].trajectory.time_s)
    assert left[0].trajectory.time_s.size == pytest.approx(700, abs=45)


def test_a_clock_jitters_for_all_alike_and_never_runs_back():
    two = [walk(name, straight((-5, y), (5, y), 1001)) for name, y in (("a", 20), ("b", 30))]
    stamped = jittered_clock(two, VIEW, 0.02, 5)
    assert_allclose(stamped[0].trajectory.time_s, stamped[1].trajectory.time_s)
    assert (stamped[0].trajectory.time_s - two[0].trajectory.time_s).std() == pytest.approx(
        0.02, rel=0.1
    )
    (wild, _) = jittered_clock(two, VIEW, 0.5, 5)  # five frames long: the value itself checks order
    assert np.diff(wild.trajectory.time_s).min() >= 1e-3 - 1e-9


def test_a_clock_gains_by_the_square_of_time():
    one = walk("a", straight((-5, 20), (5, 20), 3), step_s=50.0)
    (moved,) = drifting_clock([one], VIEW, 0.05, 0)
    # 0.05 / 2 of 100 s at the end of 100 s, and a quarter of that in the middle
    assert_allclose(moved.trajectory.time_s, [0, 50.625, 102.5])


def test_a_wrong_rate_makes_all_times_too_long_from_the_recordings_begin_on():
    one = walk("a", straight((-5, 20), (5, 20), 3), start_s=10.0, step_s=5.0)
    (slow,) = wrong_rate([one], VIEW, 0.2, 0)
    assert_allclose(slow.trajectory.time_s, [12, 18, 24])


def test_a_thing_hides_what_is_below_the_sight_line():
    thing = Thing(place_m=np.array([0.0, 4.0]), half_width_m=0.5, tall_m=1.0)
    places = np.array([[0, 3.9], [0, 5], [0.6, 5], [0.7, 5], [0, 16 / 3], [0, 8]], dtype=float)
    # From 4 m up, over 1 m at 4 m: 4 - 3 * 5 / 4 = 0.25 m at 5 m, nothing from 5.33 m on; the edge
    # of 0.5 m at 4 m is at 0.625 m at 5 m.
    assert_allclose(hidden_m(places, thing, 4.0), [0, 0.25, 0.25, 0, 0, 0], atol=1e-12)


def test_feet_are_hidden_where_things_stand_and_as_many_as_asked():
    rng = np.random.default_rng(0)
    tracks = tuple(
        walk(str(n), straight((x, 15), (x + rng.normal(), 40), 101), tall_m=1.75)
        for n, x in enumerate(rng.uniform(-8, 8, 60))
    )
    scene = Scene(
        scene_id="made-up", intrinsics=LENS, true_pose=POSE, frame_rate_hz=10, tracks=tracks
    )
    view = view_of(scene)
    found = hidden_feet(tracks, view, 0.2, 3)
    at = {
        (t.track_id, time): uv
        for t in tracks
        for time, uv in zip(t.trajectory.time_s, t.trajectory.uv, strict=True)
    }
    raised = np.concatenate([
        [at[t.track_id, s] - uv for s, uv in zip(t.trajectory.time_s, t.trajectory.uv, strict=True)]
        for t in found
    ])  # fmt: skip
    assert (raised[:, 1] >= -1e-9).all()  # never below the true foot
    assert_allclose(raised[:, 0], 0, atol=1e-6)  # of a level camera, straight above it
    assert (raised[:, 1] > 1e-6).mean() == pytest.approx(0.2, abs=0.08)
    again = draw_things(view, 0.2, 3)
    assert [t.tall_m for t in again] == [t.tall_m for t in draw_things(view, 0.2, 3)]
    assert all(0.5 <= thing.tall_m <= 0.9 for thing in again)


def test_feet_jump_with_the_box_as_long_as_something_passes():
    people = [walk(str(n), straight((-10, y), (10, y), 401), tall_m=1.75)
              for n, y in enumerate(np.linspace(20, 40, 50))]  # fmt: skip
    found = jumps(people, VIEW, 0.2, 3)
    high_m = []
    for person, track in zip(people, found, strict=True):
        own, before = track.trajectory, person.trajectory
        assert (own.top_v == before.top_v).all()
        assert_allclose(own.uv[:, 0], before.uv[:, 0], atol=1e-6)  # of a level camera
        # A point z metres above the ground at y is at v = 500 + 1000 (5 - z) / y.
        away_m = straight((-10, 20 + int(person.track_id) * 20 / 49), (10, 0), 401)[0, 1]
        high_m.append((before.uv[:, 1] - own.uv[:, 1]) * away_m / 1000)
    high = np.array(high_m)
    hidden = high > 1e-6
    assert hidden.mean() == pytest.approx(0.2, abs=0.04)
    assert 0.3 <= high[hidden].min() < 0.35
    assert 0.85 < high[hidden].max() <= 0.9
    for row in hidden:
        ends = np.flatnonzero(np.diff(np.concatenate([[False], row, [False]]).astype(int)))
        times_s = 0.1 * (ends[1::2] - ends[::2])
        inside = (ends[::2] > 0) & (ends[1::2] < row.size)
        assert (times_s[inside] >= 0.9).all()
    assert jumps(people, VIEW, 0.0, 3) == people
    again = {t.track_id: t.trajectory.uv.tobytes() for t in jumps(people[7:20], VIEW, 0.2, 3)}
    assert again == {t.track_id: t.trajectory.uv.tobytes() for t in found[7:20]}
