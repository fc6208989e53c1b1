from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose

from models.simulation.walkers import Walks
from studies.simulation.faults import FaultRange, SiteFaults, draw_faults, with_faults

NONE = SiteFaults(
    switched=np.zeros(2), hidden=np.zeros(2), riding=np.zeros(2), rounding_px=np.zeros(2)
)


def walks() -> Walks:
    """Three walkers at each of two sites, by one pixel a point and by two; one goes to the left."""
    uv = np.zeros((6, 31, 2))
    uv[..., 0] = np.arange(31)
    uv[3:, :, 0] *= 2
    uv[4, :, 0] *= -1
    uv[..., 1] = 100 * np.arange(6)[:, None]
    uv[:, 24:] = np.nan
    return Walks(uv=uv, lengths=np.full(6, 24), pose_idx=np.repeat([0, 1], 3))


def faulty(sites: SiteFaults, faults: FaultRange | None = None, seed: int = 0) -> Walks:
    rng = np.random.default_rng(seed)
    return with_faults(walks(), sites, faults or FaultRange(), 1920, rng)


def test_without_faults_walks_stay_as_they_are():
    assert_allclose(faulty(NONE).uv, walks().uv)


def test_riders_go_two_or_three_times_as_far_a_point():
    found = faulty(replace(NONE, riding=np.array([1.0, 0.0])))
    for row, length in enumerate(found.lengths):
        steps = np.diff(found.uv[row, :length, 0])
        assert np.isfinite(found.uv[row, :length]).all()
        assert np.isnan(found.uv[row, length:]).all()
        if row < 3 and length < 24:
            assert steps[0] in (2, 3)
            assert length == -(-24 // steps[0])
        else:
            assert (np.abs(steps) == (1 if row < 3 else 2)).all()


def test_switches_join_walks_of_one_site():
    found = faulty(replace(NONE, switched=np.array([0.0, 1.0])))
    assert_allclose(found.uv[:3], walks().uv[:3])
    # Nobody jumps where two are joined, but whose other half goes the other way turns about.
    steps = np.diff(found.uv[3:, :24], axis=1)
    assert_allclose(np.abs(steps), np.broadcast_to([2.0, 0.0], steps.shape))
    assert (np.ptp(steps[..., 0], axis=1) == 4).any()


def test_hidden_feet_are_higher_in_the_picture_for_a_while():
    lifted = FaultRange(hidden_px=(30.0, 30.0))
    found = faulty(replace(NONE, hidden=np.ones(2)), lifted)
    up = walks().uv[..., 1] - found.uv[..., 1]
    assert set(np.unique(up[np.isfinite(up)])) == {0.0, 30.0}
    assert ((up == 30).sum(axis=1) >= 1).all()


def test_points_are_rounded_where_they_are_and_the_seed_draws_alike():
    found = faulty(replace(NONE, rounding_px=np.array([0.0, 3.0])))
    assert_allclose(found.uv[:3], walks().uv[:3])
    assert np.nanmax(np.abs(found.uv[3:] % 3)) == 0
    one, other = (draw_faults(FaultRange(), 50, np.random.default_rng(1)) for _ in range(2))
    assert_allclose(one.hidden, other.hidden)
    assert 10 < (one.rounding_px > 0).sum() < 40
