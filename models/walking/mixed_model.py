"""A robust linear mixed model of logarithms, fitted by iterated re-weighting (IRLS) and EM.

Row j of track i, at a time w after the track's middle, is y_ij = x_ij' beta + a_i + b_i w_ij +
e_ij: the site's field, the track's random level and trend, and a deviation. a_i is Student-t
between tracks, b_i Gaussian, e_ij Student-t within a track and a first-order autoregression. Rows
that belong to something else (standing, sitting, a tracker's mistake) are outliers: a broad
Gaussian of y itself, of which each track has a share of its own. Given the weights of rows and
tracks it is a Gaussian mixed model, whose a_i and b_i are integrated out.

Source: Laird and Ware 1982 for the mixed model and its EM; Lange, Little and Taylor 1989 for the
Student-t's weights, (nu + 1) / (nu + u^2), at 4 degrees of freedom; the outliers are the mixture of
Aitkin and Tunnicliffe Wilson 1980. Ours are weights by the predicted a_i, without its variance, the
tracks' own shares, and a correlation by moments.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from models.geometry.rotation import Array, Mask
from models.serialization import stored_as
from models.tracks.observations import Rows
from models.walking import config
from models.walking.mixed_loops import (
    log_likelihoods_apart,
    moments_of_tracks,
    weights_of_tracks,
    whitened,
)

# The inverse of a Student-t's information on its middle, for a scale of 1: its weights, one on
# average, say 1. Source: Lange, Little and Taylor 1989.
FISHER = (config.FREEDOM + 3) / (config.FREEDOM + 1)


class Values(Protocol):
    """Measured `value` (M,), which of them are `valid` (M,), and whose `rows` they are."""

    @property
    def value(self) -> Array: ...  # noqa: D102
    @property
    def valid(self) -> Mask: ...  # noqa: D102
    @property
    def rows(self) -> Rows: ...  # noqa: D102


@dataclass(frozen=True, slots=True, kw_only=True)
class Normal:
    """A normal distribution: mean (P,) and covariance (P, P)."""

    mean: Array
    covariance: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class VarianceComponents:
    """The scatter of logarithms at a site.

    `between_sd` of the levels of tracks, `trend_sd` of their trends in 10 s, `within_sd` of
    deviations, `correlation` from one row to the next; the outliers' share, and the mean and
    standard deviation of their values, which are no residuals.
    """

    between_sd: float
    trend_sd: float
    within_sd: float
    correlation: float
    outlier_share: float = stored_as("other_share")
    outlier_mean: float = stored_as("other_mean")
    outlier_sd: float = stored_as("other_sd")

    @property
    def of_inliers(self) -> tuple[float, float, float, float]:
        """Standard deviations between tracks, of trends, within tracks, and the correlation."""
        sds = float(self.between_sd), float(self.trend_sd), float(self.within_sd)
        return *sds, float(self.correlation)

    @property
    def of_outliers(self) -> tuple[float, float, float]:
        """The outliers' share, mean and standard deviation."""
        return float(self.outlier_share), float(self.outlier_mean), float(self.outlier_sd)

    @property
    def total_sd(self) -> float:
        """Of one row of an unknown track."""
        return float(np.hypot(self.between_sd, self.within_sd))


@dataclass(frozen=True, slots=True, kw_only=True)
class Weights:
    """Weights of rows (M,) and tracks (N,) by re-weighting.

    `inlier` (M,) is the probability of a row to be no outlier; `effects` (N, 2) are the random
    level and trend of each track with their covariance `effect_covariance` (N, 2, 2).
    """

    row: Array
    track: Array
    inlier: Array
    effects: Array
    effect_covariance: Array

    def deviation(self, residual: Array, rows: Rows) -> Array:
        """Residuals (M,) without their track's level and trend."""
        effects = self.effects[rows.owner_idx]
        return np.asarray(residual - effects[:, 0] - effects[:, 1] * rows.when)


@dataclass(frozen=True, slots=True, kw_only=True)
class Curvature:
    """Half the second and the first derivatives of a misfit: matrix (P, P), gradient (P,).

    The tracks' levels and trends are integrated out.
    """

    matrix: Array
    gradient: Array


def regress(
    features: Array,
    values: Values,
    components: VarianceComponents,
    prior: Normal,
    begin: Array,
    settled: Callable[[Array], bool],
) -> tuple[Normal, Weights]:
    """The coefficients (P,) of features (M, P) that explain values (M,), with the rows' weights.

    Gauss-Newton from a beginning (P,), with weights anew in every round until a move (P,) is
    settled. The covariance is by the weights.
    """
    mean, precision = begin, np.linalg.inv(prior.covariance)
    for _ in range(config.MOST_ROUNDS):
        residual = values.value - features @ mean
        weights = reweigh(residual, values, components)
        sums = curvature(-features, residual, weights, values.rows, components)
        covariance = np.linalg.inv(sums.matrix + precision)
        move = -covariance @ (sums.gradient + precision @ (mean - prior.mean))
        mean = mean + move
        if settled(move):
            break
    return Normal(mean=mean, covariance=covariance), weights


def reweigh(
    residual: Array,
    values: Values,
    components: VarianceComponents,
    rounds: int = config.WEIGHT_ROUNDS,
) -> Weights:
    """Weights at given residuals (M,); rows that are not valid count for nothing."""
    rows = values.rows
    row, track, inlier, effects, covariance = weights_of_tracks(
        residual,
        values.value,
        values.valid,
        rows.owner_idx,
        rows.when,
        rows.owners,
        components.of_inliers,
        components.of_outliers,
        rounds,
    )
    return Weights(
        row=row, track=track, inlier=inlier, effects=effects, effect_covariance=covariance
    )  # fmt: skip


def curvature(
    jacobian: Array, residual: Array, weights: Weights, rows: Rows, components: VarianceComponents
) -> Curvature:
    """Gauss-Newton sums over all tracks for residuals (M,) with derivatives (M, P)."""
    white, lost = _whitened(jacobian, residual, weights, rows, components)
    lost = lost.reshape(-1, white.shape[1])
    moment = white.T @ white - lost.T @ lost
    return Curvature(matrix=moment[:-1, :-1], gradient=moment[:-1, -1])


def track_curvatures(
    jacobian: Array, residual: Array, weights: Weights, rows: Rows, components: VarianceComponents
) -> Curvature:
    """The same for each track by itself: matrix (N, P, P), gradient (N, P); for a small P."""
    white, lost = _whitened(jacobian, residual, weights, rows, components)
    moment = moments_of_tracks(white, lost, rows.owner_idx)
    return Curvature(matrix=moment[:, :-1, :-1], gradient=moment[:, :-1, -1])


def _whitened(
    jacobian: Array, residual: Array, weights: Weights, rows: Rows, components: VarianceComponents
) -> tuple[Array, Array]:
    return whitened(
        np.ascontiguousarray(jacobian),
        residual,
        weights.row,
        weights.track,
        rows.owner_idx,
        rows.linked,
        rows.when,
        components.of_inliers,
    )


def composite_log_likelihoods(
    residual: Array, values: Values, components: VarianceComponents
) -> Array:
    """The composite log likelihood (N,) of each track, by its rows apart; long ones are as short.

    For comparing candidates far apart; a row above the horizon counts as all but impossible.
    Source: Varin, Reid and Firth 2011, an independence likelihood; its weights are ours.
    """
    rows = values.rows
    return log_likelihoods_apart(
        residual,
        values.value,
        values.valid,
        rows.owner_idx,
        rows.owners,
        components.total_sd,
        components.of_outliers,
    )


def h_log_likelihood(
    residual: Array, weights: Weights, rows: Rows, components: VarianceComponents
) -> float:
    """The h-likelihood (Lee and Nelder 1996), but for what the components alone decide."""
    half = (config.FREEDOM + 1) / 2
    scaled = weights.deviation(residual, rows) / components.within_sd
    within = (weights.inlier * np.log1p(scaled**2 / config.FREEDOM)).sum()
    # Correlated rows count as fewer.
    within *= (1 - components.correlation) / (1 + components.correlation)
    level, trend = weights.effects.T
    between = np.log1p((level / components.between_sd) ** 2 / config.FREEDOM).sum()
    return float(-half * (within + between) - 0.5 * ((trend / components.trend_sd) ** 2).sum())


def em_step(
    residual: Array, values: Values, weights: Weights, components: VarianceComponents
) -> VarianceComponents:
    """The components that explain residuals best, given the weights."""
    value, valid, rows = values.value, values.valid, values.rows
    inlier_rows = np.bincount(rows.owner_idx, weights.inlier, rows.owners)
    seen = inlier_rows > 1.5
    if seen.sum() < 3:
        return components
    variance = np.diagonal(weights.effect_covariance[seen], axis1=1, axis2=2)
    squared = weights.effects[seen] ** 2 + variance
    between, trend = weights.track[seen] * squared[:, 0], squared[:, 1]
    deviation = weights.deviation(residual, rows)
    inlier = float(weights.inlier[valid].sum())
    freedom = max(0.3, 1 - float(seen.sum()) / max(inlier, 1.0))
    within = float((weights.row * deviation**2)[valid].sum()) / max(inlier, 1.0) / freedom
    correlation = _correlation(deviation, weights.row, valid, rows, inlier / float(seen.sum()))
    outlier_mean, outlier_sd = components.outlier_mean, components.outlier_sd
    outlier = (1 - weights.inlier)[valid]
    if outlier.sum() > 20:
        outlier_mean = float((outlier * value[valid]).sum() / outlier.sum())
        outlier_square = (outlier * (value[valid] - outlier_mean) ** 2).sum() / outlier.sum()
        outlier_sd = float(np.sqrt(outlier_square))
    return VarianceComponents(
        between_sd=float(np.clip(np.sqrt(between.mean()), *config.BETWEEN_SD)),
        trend_sd=float(np.clip(np.sqrt(trend.mean()), *config.TREND_SD)),
        within_sd=float(np.clip(np.sqrt(within), *config.WITHIN_SD)),
        correlation=correlation,
        outlier_share=float(np.clip((1 - weights.inlier)[valid].mean(), *config.OUTLIER_SHARE)),
        outlier_mean=float(np.clip(outlier_mean, *config.OUTLIER_MEAN)),
        outlier_sd=float(np.clip(outlier_sd, *config.OUTLIER_SD)),
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
    longer = raw + 0.5 * (1 + 3 * raw) / max(usual_length, 2.0)
    return float(np.clip(longer, 0.0, config.MOST_CORRELATION))
