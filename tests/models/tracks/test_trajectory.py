from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from models.errors import ShapeError
from models.tracks.trajectory import Trajectory, choose_step_s, cut_windows, end_to_end


def walk(count, interval_s=0.2, start_s=1000.0, u0=100.0, du=5.0):
    time_s = start_s + interval_s * np.arange(count)
    uv = np.stack([u0 + du * np.arange(count), np.full(count, 300)], axis=1)
    return Trajectory(time_s=time_s, uv=uv)


@pytest.mark.parametrize(
    ("interval_s", "count", "step_s"),
    [
        (0.2, 60, 0.4),  # every fifth frame of 25
        (0.04, 300, 0.4),  # every frame of 25
        (0.5, 30, 0.5),  # two a second: nothing finer is there
        (1 / 7, 120, 0.285),  # seven a second: two intervals
        (0.1, 41, 0.4),  # 4 s are just enough for 11 points
        (0.1, 31, 0.3),  # 3 s are not
        (0.5, 7, 0.5),  # 3 s, but there is nothing between
    ],
)
def test_the_step_follows_what_tracks_offer(interval_s, count, step_s):
    assert choose_step_s([walk(count, interval_s)] * 9) == pytest.approx(step_s, abs=1e-9)


def test_four_of_five_tracks_decide_the_step():
    assert choose_step_s([walk(100, 0.1)] * 9 + [walk(6, 0.1)]) == pytest.approx(0.4)
    assert choose_step_s([walk(100, 0.1)] * 5 + [walk(26, 0.1)] * 5) == pytest.approx(0.2)


@pytest.mark.parametrize(("rate_hz", "count"), [(30, 21), (30, 51), (30, 81), (7, 21), (11, 41)])
def test_tracks_just_long_enough_for_their_step_keep_their_last_point(lens, rate_hz, count):
    tracks = [walk(count, interval_s=1 / rate_hz, du=2.0)] * 9
    assert len(cut_windows(tracks, lens, choose_step_s(tracks))) == 9


def test_tracks_of_one_point_tell_no_step():
    assert choose_step_s([walk(1)] * 3) == 0.4


def test_without_tracks_the_step_is_the_default():
    assert choose_step_s([]) == 0.4


def test_windows_are_resampled_linearly(lens):
    windows = cut_windows([walk(30, interval_s=0.3, du=6.0)], lens, 0.4)  # 8.7 s
    assert windows.lengths.tolist() == [22]
    assert_allclose(windows.uv[0, :22, 0], 100 + 20 * 0.4 * np.arange(22), atol=1e-9)
    assert np.isnan(windows.uv[0, 22:]).all()


@pytest.mark.parametrize(
    ("samples", "lengths"),
    [(10, []), (11, [11]), (31, [31]), (32, [16, 16]), (62, [31, 31]), (63, [21, 21, 21])],
)
def test_long_runs_are_cut_into_equal_windows(lens, samples, lengths):
    windows = cut_windows([walk(samples, interval_s=0.4)], lens, 0.4)
    assert windows.lengths.tolist() == lengths


def test_a_gap_breaks_a_trajectory(lens):
    time_s = np.concatenate([0.4 * np.arange(12), 10 + 0.4 * np.arange(15)])
    track = Trajectory(time_s=time_s, uv=np.stack([10 * np.arange(27.0), np.full(27, 50.0)], 1))
    windows = cut_windows([track], lens, 0.4)
    assert windows.lengths.tolist() == [12, 15]
    assert windows.uv[1, 0, 0] == 120


def test_leaving_the_image_breaks_a_trajectory(lens):
    track = walk(40, interval_s=0.4, du=10.0)
    track.uv[20, 1] = 730.0  # a foot below the picture
    windows = cut_windows([track], lens, 0.4)
    assert windows.lengths.tolist() == [20, 19]


def test_owners_tell_whose_a_window_is(lens):
    windows = cut_windows([walk(40, 0.4), walk(5, 0.4), walk(12, 0.4)], lens, 0.4)
    assert windows.owner_idx.tolist() == [0, 0, 2]
    assert len(cut_windows([], lens, 0.4)) == 0


@pytest.mark.parametrize(
    ("time_s", "uv", "message"),
    [
        ([0.0, 1.0], [[1.0, 1.0]], r"uv: \(2, 2\) is needed"),
        ([0.0, 0.0], [[1.0, 1.0]] * 2, "increase strictly"),
        ([], np.empty((0, 2)), "at least 1 point"),
        ([0.0, 1.0], [[1.0, np.nan]] * 2, "finite"),
    ],
)
def test_a_trajectory_that_cannot_be_is_refused(time_s, uv, message):
    with pytest.raises(ShapeError, match=message):
        Trajectory(time_s=np.array(time_s), uv=np.array(uv))


def test_heads_stay_with_their_points():
    one, other = walk(4), walk(3, start_s=1001.0)
    headed = replace(one, head_uv=one.uv - (0, 90))
    assert_allclose(headed.part(np.array([1, 3])).head_uv, one.uv[[1, 3]] - (0, 90))
    assert one.part(np.array([1])).head_uv is None
    both = end_to_end([headed, other])
    assert_allclose(both.head_uv[:4], headed.head_uv)
    assert np.isnan(both.head_uv[4:]).all()
    assert end_to_end([one, other]).head_uv is None
    with pytest.raises(ShapeError, match=r"head_uv: \(4, 2\) is needed beside uv, got \(4,\)"):
        replace(one, head_uv=np.zeros(4))
