"""Boxes that end above the feet; a level camera 5 m up has them at v = 500 + 5000 / y."""

import numpy as np
import pytest

from models.tracks.loops.short_boxes import short_boxes
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
