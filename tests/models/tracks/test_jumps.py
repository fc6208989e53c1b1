"""Feet that spring up and back, in a picture of 720 rows: what is below 7.2 px is no jump."""

import numpy as np
import pytest

from models.tracks.loops.jumps import jumped


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
