"""Who walks together: hand-made walks side by side, apart, half the way, and against each other."""

import tracemalloc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.tracks.observations import Rows
from models.walking import config
from models.walking.measures import Measured, count_walking_groups, walking_groups_of

EAST = (1.0, 0.0)


def walk(start, way=EAST, steps=10, begin_s=0.0, every_s=3.0):
    """Times, places and directions of someone who walks 4 m between steps."""
    way = np.array(way) / np.linalg.norm(way)
    count = np.arange(steps)
    return (
        begin_s + every_s * count,
        np.array(start) + 4 * count[:, None] * way,
        np.tile(way, (steps, 1)),
    )


def labels_of(*walks, owners=None):
    times, places, ways = zip(*walks, strict=True)
    owner_idx = np.repeat(np.arange(len(walks)), [len(t) for t in times])
    return walking_groups_of(
        np.concatenate(times),
        owner_idx,
        np.concatenate(places),
        np.concatenate(ways),
        len(walks) if owners is None else owners,
    )


def walking_groups(labels):
    """The tracks of each walking group."""
    return sorted(np.flatnonzero(labels == label).tolist() for label in np.unique(labels))


@pytest.mark.parametrize(
    ("aside_m", "expected"), [(1.0, [[0, 1]]), (3.9, [[0, 1]]), (4.1, [[0], [1]])]
)
def test_two_side_by_side_are_a_group(aside_m, expected):
    assert walking_groups(labels_of(walk((0, 0)), walk((0, aside_m)))) == expected


def test_two_who_meet_are_none_and_those_who_bear_off_are():
    there = walk((0, 0), steps=1)
    back = walk((1, 0), (-1, 0), steps=1)
    assert walking_groups(labels_of(there, back)) == [[0], [1]]
    for turn_deg, expected in ((36, [[0, 1]]), (38, [[0], [1]])):  # cosine 0.8 is 36.9 deg
        turn = np.radians(turn_deg)
        other = walk((0, 1), (np.cos(turn), np.sin(turn)), steps=1)
        assert walking_groups(labels_of(there, other)) == expected


@pytest.mark.parametrize(("together", "expected"), [(6, [[0, 1]]), (5, [[0], [1]])])
def test_they_are_together_for_most_of_the_shorter_walk(together, expected):
    # The shorter one has 10 steps, of which so many are beside the longer one's.
    time_s, place, way = walk((0, 1))
    place = place + np.where(np.arange(10) < together, 0.0, 50.0)[:, None] * [0.0, 1.0]
    assert walking_groups(labels_of(walk((0, 0), steps=30), (time_s, place, way))) == expected


def test_the_same_place_at_another_time_is_nobodys_company():
    assert walking_groups(labels_of(walk((0, 0)), walk((0, 0), begin_s=60.0))) == [[0], [1]]


def test_who_walks_with_one_of_a_group_is_of_it():
    beside = [walk((0, 3.0 * place)) for place in (0, 2, 1, 10)]  # the third joins the first two
    assert walking_groups(labels_of(*beside)) == [[0, 1, 2], [3]]
    chain = [walk((0, 3.0 * place)) for place in (4, 0, 3, 1, 2)]
    assert walking_groups(labels_of(*chain)) == [[0, 1, 2, 3, 4]]


def test_two_groups_stay_two():
    walks = [walk((0, y)) for y in (0, 50, 1, 51, 2)]
    assert walking_groups(labels_of(*walks)) == [[0, 2, 4], [1, 3]]


def test_two_pairs_that_draw_near_are_one():
    near = np.where(np.arange(10) < 3, 6.0, 0.0)[:, None] * [0.0, 1.0]
    others = [walk((0, y)) for y in (4.5, 5.5)]
    joined = [(time_s, place + near, way) for time_s, place, way in others]
    assert walking_groups(labels_of(walk((0, 0)), walk((0, 1)), *joined)) == [[0, 1, 2, 3]]


def test_how_often_a_tracker_reports_does_not_matter():
    # Three steps a bin of 3 s count once, and so does the other's one.
    often = walk((0, 0), steps=30, every_s=1.0)
    often = (often[0], often[1] / 3, often[2])
    assert walking_groups(labels_of(often, walk((0, 1)))) == [[0, 1]]


def test_epoch_seconds_and_the_order_of_the_tracks_do_not_matter():
    epoch_s = 1_700_000_000.4
    walks = [walk((0, y), begin_s=epoch_s) for y in (0, 50, 1, 51)]
    assert walking_groups(labels_of(*walks)) == [[0, 2], [1, 3]]
    assert walking_groups(labels_of(*walks[::-1])) == [[0, 2], [1, 3]]
    assert walking_groups(labels_of(walks[1], walks[3], walks[0], walks[2])) == [[0, 1], [2, 3]]


def test_tracks_without_steps_are_each_a_group():
    assert walking_groups(labels_of(walk((0, 0)), walk((0, 1)), owners=4)) == [[0, 1], [2], [3]]
    none = walking_groups_of(
        np.empty(0), np.empty(0, np.int64), np.empty((0, 2)), np.empty((0, 2)), 2
    )
    assert walking_groups(none) == [[0], [1]]


def test_who_stands_or_is_not_on_the_ground_is_not_counted():
    walks = [walk((0, y)) for y in (0, 1, 50, 100)]
    times, places, ways = (np.concatenate(each) for each in zip(*walks, strict=True))
    speed_mps = np.repeat([1.4, 1.4, 0.3, 1.4], 10)
    measured = Measured(
        value=np.log(speed_mps),
        place=places,
        direction=ways,
        valid=np.repeat([True, True, True, False], 10),
        d_value=np.zeros((40, 3)),
        d_place=np.zeros((40, 2, 3)),
        d_direction=None,
        d_direction_noise=np.zeros((40, 3)),
        rows=Rows(
            owner_idx=np.repeat(np.arange(4), 10),
            linked=np.zeros(40, dtype=bool),
            time_s=times,
            when=np.zeros(40),
            owners=4,
        ),
    )
    assert count_walking_groups(measured) == 1


def by_all_pairs(time_bin, owner_idx, place, direction, owners):
    """The first track of each group, by every pair at every time, and paths between them."""
    together = np.zeros((owners, owners))
    for i in range(time_bin.size):
        for j in range(time_bin.size):
            near = np.hypot(*(place[i] - place[j])) < config.GROUP_NEAR_M
            if time_bin[i] == time_bin[j] and near and direction[i] @ direction[j] > 0.8:
                together[owner_idx[i], owner_idx[j]] += 1
    length = np.bincount(owner_idx, minlength=owners)
    joined = (together > 0) & (together >= 0.6 * np.minimum.outer(length, length))
    reached = np.linalg.matrix_power((joined | np.eye(owners, dtype=bool)).astype(float), owners)
    return [int(np.flatnonzero(row)[0]) for row in reached > 0]


@given(st.lists(st.tuples(*[st.integers(0, limit) for limit in (5, 6, 9, 3)]), max_size=30))
def test_groups_are_those_of_all_pairs_at_all_times(steps):
    """Steps of a track and a bin of 3 s, at a place along a line, one way or another."""
    steps = list({step[:2]: step for step in steps}.values())
    owner_idx, time_bin, east, way = np.array(steps, dtype=np.int64).reshape(-1, 4).T
    place = np.column_stack([1.5 * east, np.zeros(east.size)])
    direction = np.column_stack([np.cos(way * 0.4), np.sin(way * 0.4)])
    found = walking_groups_of(3.0 * time_bin, owner_idx, place, direction, 7)
    since = time_bin - time_bin.min(initial=time_bin.size + 9)
    assert found.tolist() == by_all_pairs(since, owner_idx, place, direction, 7)


def test_a_crowd_that_stays_together_is_a_group_and_not_a_list_of_all_its_pairs():
    """Two thousand beside one another for a minute were 40 million pairs: 1.3 GB."""
    many = [walk((0.001 * n, 0.0), steps=20) for n in range(2_000)]
    tracemalloc.start()
    assert set(labels_of(*many).tolist()) == {0}
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 50e6
