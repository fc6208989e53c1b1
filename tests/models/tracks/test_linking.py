"""Which tracks go on which: by hand, at places that are told in metres."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.geometry.ground import pixel_from_ground
from models.geometry.upright import tops_seen
from models.simulation.poses import PoseOffset
from models.tracks import config
from models.tracks.linking import (
    _both_ends,
    _clear_links,
    _of_each,
    _pairs,
    count_walks,
    link_pieces,
    walks_of,
)
from models.tracks.scenes import Scene, SceneTrack
from models.tracks.trajectory import Trajectory
from studies.faults.identities import fragments
from studies.faults.view import view_of
from tests.models.sites import LENS, PRIOR, tracks_of

START_M, VELOCITY = np.array([-3.0, 16.0]), np.array([1.2, 0.3])


def walk(from_s, to_s, *, start=START_M, velocity=VELOCITY, pose=PRIOR, tall_m=None):
    """Somebody who is at a place at 0 s and keeps a velocity, seen for a while at 10 Hz."""
    time_s = np.arange(round(10 * from_s), round(10 * to_s) + 1) / 10
    ground = np.asarray(start) + time_s[:, None] * np.asarray(velocity)
    uv, valid = pixel_from_ground(LENS, pose.rotation, pose.centre_m, ground)
    assert valid.all()
    top_v = None
    if tall_m is not None:
        tall = np.full(time_s.size, tall_m)
        top_v = tops_seen(LENS, pose.rotation, pose.centre_m, ground, tall)
    return Trajectory(time_s=1.7e9 + time_s, uv=uv, top_v=top_v)


def links(*tracks, pose=PRIOR):
    return link_pieces(tracks, LENS, pose).tolist()


def test_a_walk_in_three_pieces_is_one():
    pieces = [walk(0, 3), walk(4, 6), walk(7.5, 10)]
    assert links(*pieces) == [-1, 0, 1]
    assert walks_of(link_pieces(pieces, LENS, PRIOR)).tolist() == [0, 0, 0]
    assert count_walks(pieces, LENS, PRIOR) == 1


def test_the_order_that_they_are_given_in_changes_nothing():
    assert links(walk(7.5, 10), walk(0, 3), walk(4, 6)) == [2, -1, 1]


def test_a_longer_gap_is_not_crossed():
    assert links(walk(0, 3), walk(6.4, 9)) == [-1, 0]
    assert links(walk(0, 3), walk(6.6, 9)) == [-1, -1]


@pytest.mark.parametrize(
    "other",
    [
        {"start": START_M + [0.0, 3.0]},  # 3 m aside
        {"start": START_M + [2.4, 0.0]},  # two seconds further on
        {"velocity": [-1.2, -0.3], "start": START_M + [8.4, 2.1]},  # there, but on the way back
        {"velocity": [4.0, 1.0], "start": START_M - [9.8, 2.45]},  # there, but riding
    ],
)
def test_what_does_not_go_on_is_another(other):
    assert links(walk(0, 3), walk(4, 6, **other)) == [-1, -1]


def test_a_child_is_no_adult():
    assert links(walk(0, 3, tall_m=1.75), walk(4, 6, tall_m=1.7)) == [-1, 0]
    assert links(walk(0, 3, tall_m=1.75), walk(4, 6, tall_m=1.2)) == [-1, -1]


def test_of_two_side_by_side_each_has_their_own():
    beside = START_M + [0.0, 2.0]
    assert links(walk(0, 3), walk(0, 3, start=beside), walk(4, 6, start=beside), walk(4, 6)) == [
        -1, -1, 1, 0,
    ]  # fmt: skip


def test_who_might_be_either_is_neither():
    half = START_M + [0.0, 0.3]
    assert links(walk(0, 3), walk(0, 3, start=START_M + [0.0, 0.6]), walk(4, 6, start=half)) == [
        -1, -1, -1,
    ]  # fmt: skip


def test_pieces_are_linked_after_a_knock_too():
    knocked = PoseOffset(
        tilt_rad=math.radians(8), roll_rad=math.radians(-6), log_height=0.15, heading_rad=0.2
    ).apply(PRIOR)
    pieces = [walk(0, 3, pose=knocked), walk(4, 6, pose=knocked), walk(7.5, 10, pose=knocked)]
    assert links(*pieces) == [-1, 0, 1]


def test_who_stands_is_linked_by_the_place():
    still = {"velocity": [0.0, 0.0]}
    assert links(walk(0, 3, **still), walk(5, 8, **still)) == [-1, 0]
    assert links(walk(0, 3, **still), walk(5, 8, start=START_M + [1.5, 0], **still)) == [-1, -1]


def test_what_is_above_the_horizon_of_the_prior_is_left_alone():
    upward = replace(PRIOR, tilt_rad=-math.radians(5))
    assert links(walk(0, 3), walk(4, 6), pose=upward) == [-1, -1]


def each_against_all_others(earlier, later, misfit):
    """Links by their definition: a free pair, the likeliest first, without a free rival."""
    linked, free = np.zeros(misfit.size, dtype=bool), np.ones(misfit.size, dtype=bool)
    for pair in range(misfit.size):
        rivals = free & ((earlier == earlier[pair]) | (later == later[pair]))
        if free[pair] and (rivals & (misfit < misfit[pair] + config.CLEAR)).sum() == 1:
            linked[pair] = True
            free &= ~rivals
    return linked


@given(
    st.integers(2, 12).flatmap(
        lambda count: st.tuples(
            st.just(count),
            st.dictionaries(
                st.tuples(*[st.integers(0, count - 1)] * 2),
                st.integers(-30, -1) | st.floats(-30, -1e-9),
                min_size=1,
            ),
        )
    )
)
def test_links_are_those_of_each_pair_against_all_others(drawn):
    count, pairs = drawn
    earlier, later = np.array(list(pairs)).T.copy()
    misfit = np.array([float(value) for value in pairs.values()])
    rank = np.argsort(misfit, kind="stable")
    earlier, later, misfit = earlier[rank], later[rank], misfit[rank]
    found = _clear_links(earlier, later, misfit, _of_each(earlier, count), _of_each(later, count))
    assert found.tolist() == each_against_all_others(earlier, later, misfit).tolist()


def test_of_a_flood_of_pieces_each_has_so_many_followers_at_most():
    """A thousand that begin where a thousand others end were a million pairs."""
    flood = [walk(0, 2) for _ in range(500)] + [walk(2.5, 4.5) for _ in range(500)]
    earlier, _ = _pairs(*_both_ends(flood, LENS, PRIOR))
    assert set(np.bincount(earlier).tolist()) == {config.MOST_FOLLOWERS}
    assert set(links(*flood)) == {-1}


def test_nobody_and_a_single_one():
    assert links() == []
    assert links(walk(0, 3)) == [-1]


def test_of_a_crowd_cut_in_pieces_hardly_anybody_is_taken_for_another():
    (walked,) = tracks_of(11, (PRIOR, 120))
    rng = np.random.default_rng(1)
    # Two hundred people an hour would never meet; these come in ten minutes.
    walked = [
        replace(t, time_s=t.time_s - t.time_s[0] + start_s)
        for t, start_s in zip(walked, rng.uniform(0, 300, len(walked)), strict=True)
    ]
    scene = Scene(
        scene_id="crowd",
        intrinsics=LENS,
        true_pose=PRIOR,
        frame_rate_hz=10.0,
        tracks=tuple(
            SceneTrack(track_id=str(n), trajectory=replace(t, top_v=None), person_id=str(n))
            for n, t in enumerate(walked)
        ),
    )
    pieces = [
        piece
        for piece in fragments(scene.tracks, view_of(scene), 3.0, 1)
        if piece.trajectory.long_enough
    ]
    before = link_pieces([piece.trajectory for piece in pieces], LENS, PRIOR)
    person = np.array([int(piece.person_id) for piece in pieces])
    made = np.flatnonzero(before >= 0)
    right = person[made] == person[before[made]]
    possible = len(pieces) - np.unique(person).size
    assert right.mean() > 0.97
    assert right.sum() > 0.8 * possible
