"""Weights and densities of rows: by scipy, at their fixed point, of nothing at all."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from models.tracks.observations import Rows
from models.walking.mixed_model import (
    VarianceComponents,
    Weights,
    composite_log_likelihoods,
    curvature,
    reweigh,
    track_curvatures,
)
from tests.models.walking.given import Given

COMPONENTS = VarianceComponents(
    between_sd=0.3,
    trend_sd=0.1,
    within_sd=0.4,
    correlation=0.25,
    outlier_share=0.1,
    outlier_mean=-2.0,
    outlier_sd=0.8,
)
TOTAL_SD = 0.5  # 0.3 and 0.4 together


def rows_of(*lengths: int, owners: int | None = None) -> Rows:
    return Rows(
        owner_idx=np.repeat(np.arange(len(lengths)), lengths),
        linked=np.concatenate([np.zeros(0, dtype=bool), *(np.arange(n) > 0 for n in lengths)]),
        time_s=np.concatenate([np.zeros(0), *(1.5 * np.arange(n) for n in lengths)]),
        when=np.concatenate([np.zeros(0), *(0.15 * np.arange(n) - 0.2 for n in lengths)]),
        owners=len(lengths) if owners is None else owners,
    )


def log_density(residual, value):
    from scipy import stats  # here: it takes longer to import than these tests

    usual = stats.t.pdf(residual / TOTAL_SD, df=4) / TOTAL_SD
    return np.log(0.9 * usual + 0.1 * stats.norm.pdf(value, -2.0, 0.8))


@pytest.mark.parametrize("far", [1.0, 1e3, 1e20])
def test_the_log_likelihood_of_a_track_is_that_of_its_rows_whatever_their_number(far):
    # The product of 900 densities would be nothing at all; a density of 1e-100 is one.
    rng = np.random.default_rng(0)
    rows = rows_of(4, 900, 1)
    value = rng.normal(0, 1, 905) * far
    residual = value - 0.3
    found = composite_log_likelihoods(
        residual, Given(value, np.ones(905, dtype=bool), rows), COMPONENTS
    )
    each = log_density(residual, value)
    expected = [each[:4].sum(), each[4:904].mean() * 4, each[904]]
    assert_allclose(found, expected, rtol=1e-12)


def test_a_row_above_the_horizon_is_all_but_impossible_and_no_row_says_nothing():
    rows = rows_of(2, 1, owners=4)
    value = np.array([0.1, np.nan, np.nan])
    valid = np.array([True, False, False])
    found = composite_log_likelihoods(value, Given(value, valid, rows), COMPONENTS)
    assert_allclose(found, [log_density(0.1, 0.1) - 8.0, -8.0, 0.0, 0.0], rtol=1e-12)


def test_at_their_fixed_point_a_tracks_level_and_trend_are_the_likeliest():
    from scipy import stats  # here: it takes longer to import than these tests

    rng = np.random.default_rng(1)
    rows = rows_of(7, 12, 1)
    residual = rng.normal(0, 0.5, 20)
    residual[9] = 2.5  # one that Student-t hardly minds
    value = residual + 0.3
    found = reweigh(residual, Given(value, np.ones(20, dtype=bool), rows), COMPONENTS, rounds=300)

    def misfit(own, owner):
        here = rows.owner_idx == owner
        deviation = residual[here] - own[0] - own[1] * rows.when[here]
        # Rows of a correlation of a quarter count as (1 - 1/4) / (1 + 1/4) = 0.6 of one.
        within = 0.6 * found.inlier[here] @ -stats.t.logpdf(deviation / 0.4, df=4)
        return within - stats.t.logpdf(own[0] / 0.3, df=4) - stats.norm.logpdf(own[1] / 0.1)

    for owner in range(3):
        for step in (np.array([1e-5, 0]), np.array([0, 1e-5])):
            own = found.effects[owner]
            slope = (misfit(own + step, owner) - misfit(own - step, owner)) / 2e-5
            assert slope == pytest.approx(0.0, abs=1e-7)


def test_a_single_step_by_hand():
    # Odds of 1 to be an outlier are a share of 0.1; twice it is (2 * 0.1 + 0.1) / 3 = 0.1 again.
    level = TOTAL_SD * 2  # 3/8 (1 + 1)^(-5/2) / 0.5 = 0.13258
    usual = 0.375 / 2**2.5 / 0.5
    apart = math.sqrt(-2 * math.log(usual * 0.8 * math.sqrt(2 * math.pi)))
    value = np.array([-2.0 + 0.8 * apart])
    found = reweigh(
        np.array([level]), Given(value, np.ones(1, dtype=bool), rows_of(1)), COMPONENTS, rounds=0
    )
    assert_allclose(found.inlier, 0.9, rtol=1e-12)
    assert_allclose(found.row, 0.9, rtol=1e-12)
    assert_allclose(found.track, 1.0)


def test_of_a_track_without_valid_rows_nothing_is_known_but_the_spread():
    rows = rows_of(3, 2, owners=3)  # the third has no rows
    residual = np.array([0.1, 0.2, 0.1, 0.0, 0.0])
    valid = np.array([True, True, True, False, False])
    found = reweigh(residual, Given(residual, valid, rows), COMPONENTS)
    assert_allclose(found.row[3:], 0)
    assert_allclose(found.inlier[3:], 0)
    assert_allclose(found.effects[1:], 0)
    # A level of 0 has the weight (4 + 1) / 4.
    assert_allclose(found.track[1:], 1.25)
    assert_allclose(found.effect_covariance[1:], [np.diag([0.09 / 1.25, 0.01])] * 2)
    alone = reweigh(residual[:3], Given(residual[:3], valid[:3], rows_of(3)), COMPONENTS)
    assert_allclose(found.row[:3], alone.row)


def test_of_no_tracks_there_are_no_weights():
    none = np.empty(0)
    found = reweigh(none, Given(none, np.empty(0, dtype=bool), rows_of()), COMPONENTS)
    assert found.row.shape == (0,)
    assert found.effect_covariance.shape == (0, 2, 2)
    every = composite_log_likelihoods(
        none, Given(none, np.empty(0, dtype=bool), rows_of()), COMPONENTS
    )
    assert every.shape == (0,)


OWNER_IDX = np.repeat([0, 1, 3], [5, 1, 8])
LINKED = np.array([0, 1, 1, 1, 1, 0, 0, 1, 1, 0, 1, 1, 1, 1], dtype=bool)
ROWS = Rows(
    owner_idx=OWNER_IDX,
    linked=LINKED,
    time_s=np.arange(14.0),
    when=np.concatenate([np.linspace(-0.3, 0.3, 5), [0.0], np.linspace(-0.7, 0.7, 8)]),
    owners=4,
)
RNG = np.random.default_rng(0)
WEIGHTS = Weights(
    row=RNG.uniform(0.1, 1.2, 14),
    track=RNG.uniform(0.3, 1.2, 4),
    inlier=np.ones(14),
    effects=np.zeros((4, 2)),
    effect_covariance=np.zeros((4, 2, 2)),
)
JACOBIAN, RESIDUAL = RNG.normal(size=(14, 3)), RNG.normal(size=14)


def covariance_of(owner):
    """Of one track's rows, each deviation the larger the less its row weighs."""
    here = owner == OWNER_IDX
    run = np.cumsum(~LINKED)[here]
    order = np.arange(run.size)
    lag = np.abs(order[:, None] - order)
    together = np.where(run[:, None] == run, COMPONENTS.correlation**lag, 0.0)
    root = np.sqrt(WEIGHTS.row[here])
    deviation = COMPONENTS.within_sd**2 * together / np.outer(root, root)
    when = ROWS.when[here]
    level = COMPONENTS.between_sd**2 / WEIGHTS.track[owner]
    return deviation + level + COMPONENTS.trend_sd**2 * np.outer(when, when)


def misfit(move, owner):
    here = owner == OWNER_IDX
    residual = (RESIDUAL + JACOBIAN @ move)[here]
    return 0.5 * residual @ np.linalg.solve(covariance_of(owner), residual)


def test_the_sums_are_slopes_and_bends_of_the_likelihood():
    total = curvature(JACOBIAN, RESIDUAL, WEIGHTS, ROWS, COMPONENTS)
    each = track_curvatures(JACOBIAN, RESIDUAL, WEIGHTS, ROWS, COMPONENTS)
    for owner in (0, 1, 3):
        jacobian = JACOBIAN[owner == OWNER_IDX]
        bend = jacobian.T @ np.linalg.solve(covariance_of(owner), jacobian)
        assert_allclose(each.matrix[owner], bend, rtol=1e-10)
        slope = [
            (misfit(1e-5 * axis, owner) - misfit(-1e-5 * axis, owner)) / 2e-5 for axis in np.eye(3)
        ]
        assert_allclose(each.gradient[owner], slope, rtol=1e-6)
    assert_allclose(each.matrix.sum(axis=0), total.matrix, rtol=1e-10)
    assert_allclose(each.gradient.sum(axis=0), total.gradient, rtol=1e-10)


def test_a_track_without_rows_or_of_rows_without_weight_says_nothing():
    each = track_curvatures(JACOBIAN, RESIDUAL, WEIGHTS, ROWS, COMPONENTS)
    assert_allclose(each.matrix[2], 0)
    assert_allclose(each.gradient[2], 0)
    still = Weights(
        row=np.where(OWNER_IDX == 3, 0.0, WEIGHTS.row),
        track=WEIGHTS.track,
        inlier=WEIGHTS.inlier,
        effects=WEIGHTS.effects,
        effect_covariance=WEIGHTS.effect_covariance,
    )
    total = curvature(JACOBIAN, RESIDUAL, still, ROWS, COMPONENTS)
    assert_allclose(total.matrix, each.matrix[:2].sum(axis=0), rtol=1e-10)
    assert_allclose(total.gradient, each.gradient[:2].sum(axis=0), rtol=1e-10)


def test_no_rows_are_no_sums():
    rows = Rows(
        owner_idx=np.empty(0, dtype=np.int64),
        linked=np.empty(0, dtype=bool),
        time_s=np.empty(0),
        when=np.empty(0),
        owners=2,
    )
    weights = Weights(
        row=np.empty(0),
        track=np.ones(2),
        inlier=np.empty(0),
        effects=np.zeros((2, 2)),
        effect_covariance=np.zeros((2, 2, 2)),
    )
    total = curvature(np.empty((0, 3)), np.empty(0), weights, rows, COMPONENTS)
    assert_allclose(total.matrix, np.zeros((3, 3)))
    each = track_curvatures(np.empty((0, 3)), np.empty(0), weights, rows, COMPONENTS)
    assert_allclose(each.gradient, np.zeros((2, 3)))
