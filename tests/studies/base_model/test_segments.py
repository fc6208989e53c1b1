import numpy as np
import pytest
from numpy.testing import assert_allclose

from models.geometry.intrinsics import Intrinsics
from models.simulation.walkers import Walks
from models.tracks.trajectory import Trajectory
from studies.base_model.segments import segments_of, segments_of_walks


def track(time_s: np.ndarray, uv: np.ndarray | None = None) -> Trajectory:
    straight = np.stack([200 + 30 * time_s, 300 + 5 * time_s], axis=-1)
    return Trajectory(time_s=time_s, uv=straight if uv is None else uv)


def test_a_walk_is_cut_evenly_whatever_its_rate(lens: Intrinsics):
    fast, slow = track(np.arange(0, 12.51, 0.04)), track(np.arange(0, 12.51, 0.5))
    for walk, apart_s in ((fast, 0.04), (slow, 0.5)):
        found = segments_of([walk], lens)
        assert len(found) == 3  # of 12.5 s: no segment is longer than 6 s
        assert_allclose(found.duration_s, 12.5 / 3, atol=2 * apart_s)
        assert_allclose(found.residual_px, 0, atol=1e-9)
        begin = found.nodes_uv[0, 0]
        assert_allclose(begin, [200, 300], atol=1e-9)
        # Five nodes at equal times of a steady walk are equally far apart.
        steps = np.diff(found.nodes_uv[0], axis=0)
        assert_allclose(steps, steps[:1].repeat(4, axis=0), atol=1e-9)


def test_gaps_borders_and_too_few_points_break(lens: Intrinsics):
    time_s = np.arange(0, 5.01, 0.25)
    gap = track(np.concatenate([time_s, time_s + 7.0]))
    assert segments_of([gap], lens).owner_idx.tolist() == [0, 0]
    time_s = np.arange(0, 6.01, 0.25)
    uv = track(time_s).uv.copy()
    uv[10] = (lens.width + 3, 200)
    assert segments_of([track(time_s, uv)], lens).duration_s.tolist() == [pytest.approx(3.25)]
    sparse, brief = track(np.arange(0, 5.0, 1.3)), track(np.arange(0, 2.0, 0.1))
    assert not len(segments_of([sparse, brief], lens))
    assert not len(segments_of([], lens))


def test_owners_and_noise_are_told(lens: Intrinsics):
    rng = np.random.default_rng(0)
    time_s = np.arange(0, 6.0, 0.02)
    noisy = track(time_s, track(time_s).uv + rng.normal(0, 2.0, (time_s.size, 2)))
    found = segments_of([track(np.arange(0, 1.0, 0.1)), noisy], lens)
    assert found.owner_idx.tolist() == [1]
    assert found.residual_px[0] == pytest.approx(2.0 * np.sqrt(2), rel=0.1)
    # The curve is four times as sharp as the points: 300 of them make 4 numbers.
    assert np.abs(found.nodes_uv[0, 2] - (200 + 30 * 2.99, 300 + 5 * 2.99)).max() < 0.7
    assert found.take(np.array([0, 0])).owner_idx.tolist() == [1, 1]


def test_simulated_walks_and_tracks_of_the_same_points_are_the_same_segments(lens: Intrinsics):
    uv = np.random.default_rng(1).uniform(100, 600, (1, 11, 2))
    walks = Walks(uv=uv, lengths=np.array([11]), pose_idx=np.array([7]))
    one = segments_of_walks(walks, 0.4)
    other = segments_of([track(0.4 * np.arange(11), uv[0])], lens)
    assert_allclose(one.nodes_uv, other.nodes_uv, atol=1e-9)
    assert_allclose(one.residual_px, other.residual_px)
    assert_allclose(one.duration_s, other.duration_s)
    assert one.owner_idx.tolist() == [7]
