"""A robust linear mixed model of logarithms, fitted by iterated re-weighting (IRLS) and EM.

Row j of track i, at a time w after the track's middle, is y_ij = x_ij' beta + a_i + b_i w_ij +
e_ij: the site's field, the track's own level and trend, and a deviation. a_i is Student-t between
tracks, b_i Gaussian, e_ij Student-t within a track and a first-order autoregression. Rows that
belong to something else (standing, sitting, a tracker's mistake) are outliers: a broad Gaussian of
y itself, of which each track has a share of its own. Given the weights of rows and tracks it is a
Gaussian mixed model, whose a_i and b_i are integrated out.

Source: Laird and Ware 1982 for the mixed model and its EM; Lange, Little and Taylor 1989 for the
Student-t's weights, (nu + 1) / (nu + u^2), at 4 degrees of freedom; the outliers are the mixture of
Aitkin and Tunnicliffe Wilson 1980. Ours are weights by the predicted a_i, without its variance, the
tracks' own shares, and a correlation by moments.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from models.estimation.joint.observations import Rows
from models.geometry.rotation import Array, Mask
from models.packing import stored_as

_FREEDOM = 4.0  # of both Student-t
# The inverse of a Student-t's information on its middle, for a scale of 1: its weights, one on
# average, say 1. Source: Lange, Little and Taylor 1989.
FISHER = (_FREEDOM + 3) / (_FREEDOM + 1)
_ODDS_CLIP = 30.0
_SHARE_WEIGHT = 2.0  # rows that the site's share counts for in a track's own
_SHARE_ROUNDS = 4
_INDEPENDENT_ROWS = 4  # a long track says no more than so many about which start is the best


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """How logarithms scatter at a site.

    `between_sd` of the levels of tracks, `trend_sd` of their trends in 10 s, `within_sd` of
    deviations, `correlation` from one row to the next; the outliers' share, and their mean and
    spread (of the value, not the residual).
    """

    between_sd: float
    trend_sd: float
    within_sd: float
    correlation: float
    outlier_share: float = stored_as("other_share")
    outlier_mean: float = stored_as("other_mean")
    outlier_sd: float = stored_as("other_sd")

    @property
    def total_sd(self) -> float:
        """Of one row of an unknown track."""
        return float(np.hypot(self.between_sd, self.within_sd))


@dataclass(frozen=True, slots=True, kw_only=True)
class Weights:
    """What re-weighting found: rows (M,) and tracks (N,).

    `inlier` (M,) is the probability of a row to be no outlier; `own` (N, 2) level and trend of
    each track with their covariance `own_covariance` (N, 2, 2).
    """

    row: Array
    track: Array
    inlier: Array
    own: Array
    own_covariance: Array

    def deviation(self, residual: Array, rows: Rows) -> Array:
        """Residuals (M,) without their track's own level and trend."""
        own = self.own[rows.owner_idx]
        return np.asarray(residual - own[:, 0] - own[:, 1] * rows.when)


@dataclass(frozen=True, slots=True, kw_only=True)
class Curvature:
    """Half the second and the first derivatives of a misfit: matrix (P, P), gradient (P,).

    The tracks' own levels and trends are integrated out.
    """

    matrix: Array
    gradient: Array


def log_density(residual: Array, value: Array, spread: Spread) -> tuple[Array, Array]:
    """Log densities (M,) of inliers and of outliers."""
    scaled = residual / spread.total_sd
    half = (_FREEDOM + 1) / 2
    constant = math.lgamma(half) - math.lgamma(_FREEDOM / 2) - 0.5 * math.log(_FREEDOM * math.pi)
    inlier = constant - half * np.log1p(scaled**2 / _FREEDOM) - np.log(spread.total_sd)
    outlier = -0.5 * ((value - spread.outlier_mean) / spread.outlier_sd) ** 2
    outlier = outlier - np.log(spread.outlier_sd) - 0.5 * np.log(2 * np.pi)
    return np.asarray(inlier), np.asarray(outlier)


def reweigh(
    residual: Array, value: Array, valid: Mask, rows: Rows, spread: Spread, rounds: int = 3
) -> Weights:
    """Weights at given residuals (M,); rows that are not valid count for nothing."""
    inlier, outlier = log_density(residual, value, spread)
    odds = np.exp(np.clip(outlier - inlier, -_ODDS_CLIP, _ODDS_CLIP))
    probability = _inlier_probabilities(odds, valid, rows, spread)
    # Correlated rows count as fewer.
    precision = (1 - spread.correlation) / (1 + spread.correlation) / spread.within_sd**2
    weights = Weights(
        row=probability,
        track=np.ones(rows.owners),
        inlier=probability,
        own=np.zeros((rows.owners, 2)),
        own_covariance=np.zeros((rows.owners, 2, 2)),
    )
    for _ in range(rounds):
        weights = _reweighed(residual, weights, rows, spread, precision)
    return weights


def _inlier_probabilities(odds: Array, valid: Mask, rows: Rows, spread: Spread) -> Array:
    """The probability (M,) of each row to be an inlier, each track with a share of its own.

    Someone who stands through most of a track stands in the rest of it too, whatever the noise
    makes of it.
    """
    number = np.bincount(rows.owner_idx, valid, rows.owners)
    share = np.full(rows.owners, spread.outlier_share)
    for _ in range(_SHARE_ROUNDS):
        outlier = share[rows.owner_idx] * odds
        inlier = np.where(valid, 1 - outlier / (outlier + 1 - share[rows.owner_idx]), 0.0)
        outliers = number - np.bincount(rows.owner_idx, inlier, rows.owners)
        share = (_SHARE_WEIGHT * spread.outlier_share + outliers) / (_SHARE_WEIGHT + number)
    return np.asarray(inlier)


def _reweighed(
    residual: Array, weights: Weights, rows: Rows, spread: Spread, precision: float
) -> Weights:
    row = weights.row * precision
    sums: list[Array] = [
        np.asarray(np.bincount(rows.owner_idx, row * factor, rows.owners), np.float64)
        for factor in (1.0, rows.when, rows.when**2, residual, residual * rows.when)
    ]
    held = _held(sums[0], sums[1], sums[2], weights.track, spread)
    covariance = _inverse(held)
    own = np.einsum("nij,nj->ni", covariance, np.stack([sums[3], sums[4]], axis=1))
    track = (_FREEDOM + 1) / (_FREEDOM + (own[:, 0] / spread.between_sd) ** 2)
    found = replace(weights, track=track, own=own, own_covariance=covariance)
    deviation = found.deviation(residual, rows)
    doubt = (_FREEDOM + 1) / (_FREEDOM + (deviation / spread.within_sd) ** 2)
    return replace(found, row=weights.inlier * doubt)


def _held(one: Array, mixed: Array, square: Array, track: Array, spread: Spread) -> Array:
    """Precisions (N, 2, 2) of level and trend: what the rows say, and the spread's hold."""
    held = np.empty((one.size, 2, 2))
    held[:, 0, 0] = one + track / spread.between_sd**2
    held[:, 0, 1] = held[:, 1, 0] = mixed
    held[:, 1, 1] = square + spread.trend_sd**-2
    return held


def _inverse(matrices: Array) -> Array:
    """Inverses of symmetric, positive 2 x 2 matrices (N, 2, 2)."""
    a, b, d = matrices[:, 0, 0], matrices[:, 0, 1], matrices[:, 1, 1]
    adjugate = np.stack([np.stack([d, -b], -1), np.stack([-b, a], -1)], -2)
    return np.asarray(adjugate / (a * d - b * b)[:, None, None])


def curvature(
    jacobian: Array, residual: Array, weights: Weights, rows: Rows, spread: Spread
) -> Curvature:
    """Gauss-Newton sums over all tracks for residuals (M,) with derivatives (M, P)."""
    white = _whitened(jacobian, residual, weights, rows, spread)
    owners, by_level = _by_track(white * white[:, -2:-1], rows)
    _, by_trend = _by_track(white * white[:, -1:], rows)
    held = _held(by_level[:, -2], by_level[:, -1], by_trend[:, -1], weights.track[owners], spread)
    free = _inverse(held)
    both = np.stack([by_level, by_trend], axis=1)  # (K, 2, P + 3)
    lost = np.swapaxes(both, 1, 2) @ free @ both
    moment = white.T @ white - lost.sum(axis=0)
    return Curvature(matrix=moment[:-3, :-3], gradient=moment[:-3, -3])


def track_curvatures(
    jacobian: Array, residual: Array, weights: Weights, rows: Rows, spread: Spread
) -> Curvature:
    """The same for each track by itself: matrix (N, P, P), gradient (N, P); for a small P."""
    white = _whitened(jacobian, residual, weights, rows, spread)
    count = white.shape[1]
    products = (white[:, :, None] * white[:, None, :]).reshape(-1, count * count)
    owners, flat = _by_track(products, rows)
    moment = np.zeros((rows.owners, count, count))
    moment[owners] = flat.reshape(-1, count, count)
    held = _held(moment[:, -2, -2], moment[:, -2, -1], moment[:, -1, -1], weights.track, spread)
    moment = moment - moment[:, :, -2:] @ _inverse(held) @ moment[:, -2:, :]
    return Curvature(matrix=moment[:, :-3, :-3], gradient=moment[:, :-3, -3])


def _whitened(
    jacobian: Array, residual: Array, weights: Weights, rows: Rows, spread: Spread
) -> Array:
    """Rows (M, P + 3): derivatives, residual, level and trend, of unit variance, uncorrelated.

    Deviations are a first-order autoregression. Source: Prais and Winsten 1954.
    """
    own = np.stack([np.ones(len(rows)), rows.when], axis=1)
    stacked = np.concatenate([jacobian, residual[:, None], own], axis=1)
    stacked *= np.sqrt(weights.row)[:, None]
    before = np.roll(stacked, 1, axis=0)
    rho = spread.correlation
    white = np.where(rows.linked[:, None], (stacked - rho * before) / np.sqrt(1 - rho**2), stacked)
    return np.asarray(white / spread.within_sd)


def _by_track(values: Array, rows: Rows) -> tuple[npt.NDArray[np.int64], Array]:
    """Which tracks have rows (K,), and the sums (K, D) of values (M, D) over each one's."""
    if not len(rows):
        return np.empty(0, dtype=np.int64), np.empty((0, values.shape[1]))
    firsts = np.flatnonzero(np.diff(rows.owner_idx, prepend=-1))
    return rows.owner_idx[firsts], np.asarray(np.add.reduceat(values, firsts, axis=0))


def composite_log_likelihoods(
    residual: Array, value: Array, valid: Mask, rows: Rows, spread: Spread
) -> Array:
    """The composite log likelihood (N,) of each track, by its rows apart; long ones are as short.

    For comparing candidates far apart; a row above the horizon counts as all but impossible.
    Source: Varin, Reid and Firth 2011, an independence likelihood; its weights are ours.
    """
    inlier, outlier = log_density(residual, value, spread)
    share = spread.outlier_share
    both = np.logaddexp(inlier + math.log1p(-share), outlier + math.log(share))
    density = np.where(valid, both, -8.0)
    total = np.bincount(rows.owner_idx, density, rows.owners)
    number = np.bincount(rows.owner_idx, minlength=rows.owners)
    return np.asarray(total / np.maximum(number, 1) * np.minimum(number, _INDEPENDENT_ROWS))


def hierarchical_log_likelihood(
    residual: Array, weights: Weights, rows: Rows, spread: Spread
) -> float:
    """The h-likelihood (Lee and Nelder 1996), but for what the spread alone decides."""
    half = (_FREEDOM + 1) / 2
    scaled = weights.deviation(residual, rows) / spread.within_sd
    within = (weights.inlier * np.log1p(scaled**2 / _FREEDOM)).sum()
    # Correlated rows count as fewer.
    within *= (1 - spread.correlation) / (1 + spread.correlation)
    level, trend = weights.own.T
    between = np.log1p((level / spread.between_sd) ** 2 / _FREEDOM).sum()
    return float(-half * (within + between) - 0.5 * ((trend / spread.trend_sd) ** 2).sum())


def relearn(
    residual: Array, value: Array, valid: Mask, rows: Rows, weights: Weights, spread: Spread
) -> Spread:
    """The spread that explains residuals best, given the weights: a step of EM."""
    inlier_rows = np.bincount(rows.owner_idx, weights.inlier, rows.owners)
    seen = inlier_rows > 1.5
    if seen.sum() < 3:
        return spread
    own = weights.own[seen] ** 2 + np.diagonal(weights.own_covariance[seen], axis1=1, axis2=2)
    between, trend = weights.track[seen] * own[:, 0], own[:, 1]
    deviation = weights.deviation(residual, rows)
    inlier = float(weights.inlier[valid].sum())
    freedom = max(0.3, 1 - float(seen.sum()) / max(inlier, 1.0))
    within = float((weights.row * deviation**2)[valid].sum()) / max(inlier, 1.0) / freedom
    correlation = _correlation(deviation, weights.row, valid, rows, inlier / float(seen.sum()))
    outlier_mean, outlier_sd = spread.outlier_mean, spread.outlier_sd
    outlier = (1 - weights.inlier)[valid]
    if outlier.sum() > 20:
        outlier_mean = float((outlier * value[valid]).sum() / outlier.sum())
        outlier_square = (outlier * (value[valid] - outlier_mean) ** 2).sum() / outlier.sum()
        outlier_sd = float(np.sqrt(outlier_square))
    return Spread(
        between_sd=float(np.clip(np.sqrt(between.mean()), 0.02, 0.5)),
        trend_sd=float(np.clip(np.sqrt(trend.mean()), 0.005, 0.3)),
        within_sd=float(np.clip(np.sqrt(within), 0.01, 0.5)),
        correlation=correlation,
        outlier_share=float(np.clip((1 - weights.inlier)[valid].mean(), 0.02, 0.8)),
        outlier_mean=float(np.clip(outlier_mean, -3.0, 1.0)),
        outlier_sd=float(np.clip(outlier_sd, 0.3, 1.5)),
    )


def _correlation(
    deviation: Array, weight: Array, valid: Mask, rows: Rows, usual_length: float
) -> float:
    later = np.flatnonzero(rows.linked & valid & np.roll(valid, 1))
    shared = np.sqrt(weight[later] * weight[later - 1])
    product = (shared * deviation[later] * deviation[later - 1]).sum()
    power = 0.5 * (shared * (deviation[later] ** 2 + deviation[later - 1] ** 2)).sum()
    if power <= 0:
        return 0.0
    raw = float(product / power)
    # Taking a track's own mean off makes its rows look less alike than they are.
    return float(np.clip(raw + 0.5 * (1 + 3 * raw) / max(usual_length, 2.0), 0.0, 0.8))
