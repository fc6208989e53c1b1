"""Sums of whitened rows, against the likelihood of the mixed model with its covariance written out.

Rows and tracks have weights here, one track has a gap and another no rows.
"""

import numpy as np
from numpy.testing import assert_allclose

from models.tracks.observations import Rows
from models.walking.mixed.model import Weights, curvature, track_curvatures
from tests.models.walking.mixed.test_weights import COMPONENTS

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
