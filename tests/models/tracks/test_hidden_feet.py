"""Boxes that end above the feet; a level camera 5 m up has them at v = 500 + 5000 / y."""

import numpy as np
import pytest

from models.tracks.hidden_feet import jumped, short_boxes
from tests.models.sites import KNOCKED
from tests.models.tracks.test_linking import walk

TALL_M = 1.75


def boxes(away_m, hidden_m, aside_m=0.0):
    """Lower edges (N, 2) and upper edges (N,) of somebody whose lowest metres are hidden."""
    away_m = np.asarray(away_m, dtype=np.float64)
    lower = 500 + 1000 * (5.0 - np.asarray(hidden_m)) / away_m
    across = 1000 + 1000 * (aside_m + 0 * away_m) / away_m
    return np.stack([across, lower], axis=1), 500 + 1000 * (5.0 - TALL_M) / away_m


def short(*tracks):
    """Which points are short, a list for each track."""
    bounds = np.cumsum([0, *(top_v.size for _, top_v in tracks)])
    uv, top_v = (np.concatenate(each) for each in zip(*tracks, strict=True))
    found = short_boxes(uv, top_v, bounds)
    return [each.tolist() for each in np.split(found, bounds[1:-1])]


def test_whose_lower_body_is_hidden_is_short_where_it_is_and_nowhere_else():
    away_m = np.linspace(30, 12, 40)
    hidden_m = np.where((np.arange(40) >= 10) & (np.arange(40) < 25), 0.7, 0.0)
    (found,) = short(boxes(away_m, hidden_m))  # ln(1.05 / 1.75) = -0.51
    assert found == (hidden_m > 0).tolist()


@pytest.mark.parametrize(("hidden_m", "told"), [(0.15, False), (0.25, True)])
def test_a_shoe_does_not_count_and_a_shin_does(hidden_m, told):
    # ln(1.6 / 1.75) = -0.090 and ln(1.5 / 1.75) = -0.154, on either side of -0.12.
    hidden = np.where(np.arange(40) < 8, hidden_m, 0.0)
    (found,) = short(boxes(np.linspace(30, 12, 40), hidden))
    assert found == (hidden > 0.2).tolist()
    assert any(found) == told


def test_of_three_in_five_that_are_hidden_the_others_tell():
    hidden_m = np.where(np.arange(50) % 5 < 3, 0.8, 0.0)
    (found,) = short(boxes(np.linspace(30, 12, 50), hidden_m))
    assert found == (hidden_m > 0).tolist()


def test_nothing_is_short_whatever_the_pose_and_the_way():
    tracks = [walk(0, 10, pose=KNOCKED, tall_m=1.6), walk(0, 10, velocity=[0.2, 1.3], tall_m=1.9)]
    assert all(np.isfinite(track.top_v).all() for track in tracks)
    found = short(*((track.uv, track.top_v) for track in tracks))
    assert not any(map(any, found))
    (stands,) = short(boxes(np.full(30, 20.0), 0.0))
    assert not any(stands)


def test_who_is_hidden_all_along_is_taken_for_small():
    assert not any(short(boxes(np.linspace(30, 12, 40), 0.7))[0])


def test_noise_of_a_detector_is_no_hidden_foot():
    rng = np.random.default_rng(0)
    uv, top_v = boxes(np.linspace(30, 12, 400), 0.0)
    tall = uv[:, 1] - top_v
    (found,) = short((uv, uv[:, 1] - tall * np.exp(rng.normal(0, 0.06, 400))))
    assert sum(found) <= 1  # 0.30 is 5 sd


def test_too_few_boxes_and_none_say_nothing():
    hidden_m = np.where(np.arange(8) < 2, 0.8, 0.0)
    uv, top_v = boxes(np.linspace(30, 12, 8), hidden_m)
    assert short((uv, top_v))[0] == (hidden_m > 0).tolist()
    assert not any(short((uv[1:], top_v[1:]))[0])
    unknown = np.where(np.arange(8) == 5, np.nan, top_v)
    below = np.where(np.arange(8) == 5, uv[:, 1] + 3, top_v)
    assert short((uv, unknown), (uv, below), (uv, top_v)) == [
        [False] * 8,
        [False] * 8,
        (hidden_m > 0).tolist(),
    ]
    assert short((uv[:0], top_v[:0]), (uv[:1], top_v[:1])) == [[], [False]]
    assert short_boxes(np.empty((0, 2)), np.empty(0), np.zeros(1, dtype=np.int64)).size == 0


def jumps(v, *, step_s=0.1, more=()):
    """Which points jumped of tracks down the picture, one value a step; a list for each."""
    tracks = [np.asarray(each, dtype=np.float64) for each in (v, *more)]
    bounds = np.cumsum([0, *(each.size for each in tracks)])
    time_s = np.concatenate([1.7e9 + step_s * np.arange(each.size) for each in tracks])
    uv = np.stack([np.full(time_s.size, 400.0), np.concatenate(tracks)], axis=1)
    found = jumped(time_s, uv, bounds, 720.0)
    return [each.tolist() for each in np.split(found, bounds[1:-1])]


def raised(by, where, count=60):
    """Somebody who comes 2 px nearer with each step, and where the box ends by so much higher."""
    v, high = 300 + 2.0 * np.arange(count), np.zeros(count, dtype=bool)
    high[where] = True
    return v - by * high, high.tolist()


@pytest.mark.parametrize("where", [slice(20, 30), slice(1, 2), slice(5, 59), slice(40, 41)])
def test_what_springs_up_and_back_is_found(where):
    v, high = raised(40, where)
    assert jumps(v) == [high]


def test_two_jumps_of_one_track_and_others_beside_it():
    v, high = raised(40, [*range(10, 20), *range(35, 50)])
    calm, _ = raised(0, slice(0))
    assert jumps(calm, more=(v, calm[:5], v[:0], v)) == [[False] * 60, high, [False] * 5, [], high]


@pytest.mark.parametrize(("by", "told"), [(7, False), (8, True)])
def test_a_jump_is_at_least_a_hundredth_of_the_picture(by, told):
    v, high = raised(by, slice(20, 30))
    assert jumps(v) == [high if told else [False] * 60]


def test_a_walk_may_begin_and_end_in_the_air():
    v, high = raised(40, [*range(12), *range(50, 60)])
    assert jumps(v) == [high]
    most, _ = raised(40, slice(30, 60))
    assert not any(jumps(most)[0])  # half of it: nobody knows which half is wrong
    assert sum(jumps(raised(40, slice(31, 60))[0])[0]) == 29
    long, high = raised(40, slice(80, 140), count=140)
    assert jumps(long) == [high]  # 5.9 s from the first to the last
    assert not any(jumps(raised(40, slice(80, 142), count=142)[0])[0])


def test_a_jump_that_is_not_undone_is_none():
    middle = (np.arange(200) >= 90) & (np.arange(200) < 110)  # 9 s from either end
    forward = 300 + 1.0 * np.arange(200)
    assert not any(jumps(forward - 40 * (np.arange(200) >= 90))[0])  # up for good
    assert not any(jumps(forward + 40 * middle)[0])  # down, and up again
    back = forward - 40 * middle
    back[110:] += 50  # 90 down after 40 up
    assert not any(jumps(back)[0])


def test_in_the_air_for_six_seconds_at_most():
    v, high = raised(40, slice(10, 41))  # from the first to the last, 3.0 s at 0.1 s
    assert jumps(v, step_s=0.19) == [high]  # 5.7 s
    assert not any(jumps(v, step_s=0.21)[0])  # 6.3 s


def test_feet_that_always_shake_do_not_jump():
    rng = np.random.default_rng(0)
    shaken = 300 + 2.0 * np.arange(200) + rng.normal(0, 10, 200)
    assert not any(jumps(shaken)[0])
    high = np.zeros(200, dtype=bool)
    high[80:100] = True
    found = np.array(jumps(shaken - 150 * high)[0])
    assert (found == high).all()


def test_too_few_points_say_nothing():
    v, high = raised(40, slice(3, 5), count=10)
    assert jumps(v) == [high]
    assert jumps(v[:9]) == [[False] * 9]
    assert jumped(np.empty(0), np.empty((0, 2)), np.zeros(1, dtype=np.int64), 720.0).size == 0
