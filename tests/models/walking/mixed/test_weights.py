"""Weights and densities of rows: by scipy, at their fixed point, of nothing at all."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from models.tracks.observations import Rows
from models.walking.mixed.model import VarianceComponents, composite_log_likelihoods, reweigh
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
