"""The likelihood against its own definition: covariances written out, mixtures drawn."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from models.geometry.rotation import Array
from models.tracks.observations import Rows
from models.walking.mixed_model import (
    VarianceComponents,
    Weights,
    composite_log_likelihoods,
    curvature,
    em_step,
    reweigh,
    track_curvatures,
)
from tests.models.walking.given import Given

COMPONENTS = VarianceComponents(
    between_sd=0.2,
    trend_sd=0.1,
    within_sd=0.1,
    correlation=0.5,
    outlier_share=0.1,
    outlier_mean=-2.0,
    outlier_sd=0.8,
)


def rows_of(lengths: list[int]) -> Rows:
    owner_idx = np.repeat(np.arange(len(lengths)), lengths)
    time_s = np.concatenate([1.5 * np.arange(length) for length in lengths])
    when = np.concatenate([0.15 * (np.arange(n) - (n - 1) / 2) for n in lengths])
    linked = np.concatenate([np.arange(n) > 0 for n in lengths])
    return Rows(
        owner_idx=owner_idx, linked=linked, time_s=time_s, when=when, owners=len(lengths)
    )  # fmt: skip


def even_weights(rows: Rows) -> Weights:
    return Weights(
        row=np.ones(len(rows)),
        track=np.ones(rows.owners),
        inlier=np.ones(len(rows)),
        effects=np.zeros((rows.owners, 2)),
        effect_covariance=np.zeros((rows.owners, 2, 2)),
    )


def covariance_of(rows: Rows, owner: int) -> Array:
    """Level, trend and autoregressive deviations of one track, written out.

    A track's first deviation has the variance within, as every later one has.
    """
    when = rows.when[rows.owner_idx == owner]
    apart = np.abs(np.arange(when.size)[:, None] - np.arange(when.size))
    deviations = COMPONENTS.within_sd**2 * COMPONENTS.correlation**apart
    return COMPONENTS.between_sd**2 + COMPONENTS.trend_sd**2 * np.outer(when, when) + deviations


def test_curvature_is_that_of_the_covariance_written_out():
    rng = np.random.default_rng(0)
    rows = rows_of([6, 1, 9])
    jacobian, residual = rng.normal(size=(16, 4)), rng.normal(size=16)
    matrix, gradient = np.zeros((4, 4)), np.zeros(4)
    for owner in range(3):
        own = rows.owner_idx == owner
        solved = np.linalg.solve(
            covariance_of(rows, owner), np.column_stack([jacobian[own], residual[own]])
        )
        matrix += jacobian[own].T @ solved[:, :4]
        gradient += jacobian[own].T @ solved[:, 4]
    said = curvature(jacobian, residual, even_weights(rows), rows, COMPONENTS)
    assert_allclose(said.matrix, matrix, rtol=1e-9)
    assert_allclose(said.gradient, gradient, rtol=1e-9)
    each = track_curvatures(jacobian, residual, even_weights(rows), rows, COMPONENTS)
    assert_allclose(each.matrix.sum(axis=0), matrix, rtol=1e-9)
    assert_allclose(each.gradient.sum(axis=0), gradient, rtol=1e-9)


def test_someone_who_stands_counts_for_nothing_whatever_noise_makes_of_it():
    rows = rows_of([10, 10])
    value = np.concatenate([np.full(10, 0.3), np.full(10, -2.5)])
    value[14] = 0.0  # one step of the standing one looks like a walk
    residual = value - 0.3
    weights = reweigh(residual, Given(value, np.ones(20, dtype=bool), rows), COMPONENTS)
    assert weights.inlier[:10].min() > 0.99
    assert weights.inlier[[*range(10, 14), *range(15, 20)]].max() < 0.001
    one = slice(14, 15)
    alone = reweigh(
        residual[one], Given(value[one], np.ones(1, dtype=bool), rows_of([1])), COMPONENTS
    )
    assert 1 - weights.inlier[14] > 4 * (1 - alone.inlier[0])


def test_a_runner_weighs_less_than_a_walker():
    rows = rows_of([8, 8])
    residual = np.concatenate([np.full(8, 0.1), np.full(8, 0.9)])
    weights = reweigh(residual, Given(residual + 0.3, np.ones(16, dtype=bool), rows), COMPONENTS)
    assert weights.track[1] < 0.4 * weights.track[0]
    assert_allclose(weights.effects[:, 0], [0.1, 0.9], atol=0.05)


def test_the_spread_of_a_simulated_crowd_is_learned():
    rng = np.random.default_rng(1)
    lengths = [12] * 300
    rows = rows_of(lengths)
    fresh = rng.normal(0, 0.08 * np.sqrt(1 - 0.4**2), (300, 12))
    deviation = np.empty((300, 12))
    deviation[:, 0] = rng.normal(0, 0.08, 300)
    for place in range(1, 12):
        deviation[:, place] = 0.4 * deviation[:, place - 1] + fresh[:, place]
    residual = (rng.normal(0, 0.2, (300, 1)) + deviation).ravel()
    standing = rng.random(300) < 0.15
    value = residual + 0.3
    value[standing[rows.owner_idx]] = rng.normal(-2.5, 0.5, int(standing.sum()) * 12)
    residual = value - 0.3
    components, valid = COMPONENTS, np.ones(len(rows), dtype=bool)
    for _ in range(12):
        weights = reweigh(residual, Given(value, valid, rows), components)
        components = em_step(residual, Given(value, valid, rows), weights, components)
    # Student-t of 4 degrees of freedom stands for a normal with about 0.84 of its deviation.
    assert components.between_sd == pytest.approx(0.84 * 0.2, rel=0.15)
    assert components.within_sd == pytest.approx(0.84 * 0.08, rel=0.15)
    assert components.outlier_share == pytest.approx(0.15, abs=0.03)
    assert components.outlier_mean == pytest.approx(-2.5, abs=0.15)


def test_a_long_track_does_not_outvote_short_ones():
    rows = rows_of([40, 4])
    residual = np.full(44, 0.1)
    long, short = composite_log_likelihoods(
        residual, Given(residual, np.ones(44, dtype=bool), rows), COMPONENTS
    )
    assert long == pytest.approx(short)
    above = np.concatenate([np.zeros(40, dtype=bool), np.ones(4, dtype=bool)])
    assert composite_log_likelihoods(residual, Given(residual, above, rows), COMPONENTS)[
        0
    ] == pytest.approx(-32.0)
