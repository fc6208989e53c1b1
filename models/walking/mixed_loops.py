"""Loops over the rows of the mixed model: weights, densities, and sums of derivatives.

The rows of a track stand together. The model is that of `mixed_model`.
"""

import math

import numpy as np

from models.compiled import compiled
from models.geometry.rotation import Array, Index, Mask
from models.walking import config

_LEAST_ODDS, _MOST_ODDS = math.exp(-30.0), math.exp(30.0)
_FAR_FROM_1 = 1e100


@compiled
def weights_of_tracks(
    residual: Array,
    value: Array,
    valid: Mask,
    owner_idx: Index,
    when: Array,
    owners: int,
    components: tuple[float, float, float, float],
    outliers: tuple[float, float, float],
    rounds: int,
) -> tuple[Array, Array, Array, Array, Array]:
    """Weights of rows (M,) and of tracks (N,), of rows to be inliers, and random levels and trends.

    Of M rows there are residuals, values, which are valid, owners and times since the middles of
    their tracks in 10 s; `components` and `outliers` are those of `VarianceComponents`. Random
    levels and trends are (N, 2), with covariances (N, 2, 2).
    """
    between_sd, trend_sd, within_sd, correlation = components
    total_sd = math.sqrt(between_sd**2 + within_sd**2)
    scales = _scales_of(total_sd, outliers)
    # Correlated rows count as fewer.
    precision = (1 - correlation) / (1 + correlation) / within_sd**2
    row, inlier = np.zeros(residual.size), np.zeros(residual.size)
    track, effects, covariance = np.ones(owners), np.zeros((owners, 2)), np.zeros((owners, 2, 2))
    bounds = _bounds_of(owner_idx, owners)
    for owner in range(owners):
        first, last = bounds[owner]
        for j in range(first, last):
            usual, unusual = _densities(residual[j], value[j], scales)
            row[j] = min(max(unusual / usual, _LEAST_ODDS), _MOST_ODDS)
        _find_inliers(row[first:last], valid[first:last], outliers[0], inlier[first:last])
        row[first:last] = inlier[first:last]
        for _ in range(rounds):
            one, mixed, square, level_sum, trend_sum = 0.0, 0.0, 0.0, 0.0, 0.0
            for j in range(first, last):
                weight = row[j] * precision
                one += weight
                mixed += weight * when[j]
                square += weight * when[j] ** 2
                level_sum += weight * residual[j]
                trend_sum += weight * residual[j] * when[j]
            one += track[owner] / between_sd**2
            square += 1 / trend_sd**2
            determinant = one * square - mixed * mixed
            covariance[owner, 0, 0], covariance[owner, 1, 1] = square, one
            covariance[owner, 0, 1], covariance[owner, 1, 0] = -mixed, -mixed
            covariance[owner] /= determinant
            level = (square * level_sum - mixed * trend_sum) / determinant
            trend = (one * trend_sum - mixed * level_sum) / determinant
            effects[owner, 0], effects[owner, 1] = level, trend
            track[owner] = (config.FREEDOM + 1) / (config.FREEDOM + (level / between_sd) ** 2)
            for j in range(first, last):
                deviation = (residual[j] - level - trend * when[j]) / within_sd
                row[j] = inlier[j] * (config.FREEDOM + 1) / (config.FREEDOM + deviation * deviation)
    return row, track, inlier, effects, covariance


@compiled
def log_likelihoods_apart(
    residual: Array,
    value: Array,
    valid: Mask,
    owner_idx: Index,
    owners: int,
    total_sd: float,
    outliers: tuple[float, float, float],
) -> Array:
    """The mean log density of each track's rows, times how many of them are independent (N,)."""
    share, scales = outliers[0], _scales_of(total_sd, outliers)
    found = np.zeros(owners)
    bounds = _bounds_of(owner_idx, owners)
    for owner in range(owners):
        first, last = bounds[owner]
        total, product = 0.0, 1.0  # a logarithm of many rows' densities, not one of each
        for j in range(first, last):
            if not valid[j]:
                total += config.ABOVE_HORIZON
                continue
            usual, unusual = _densities(residual[j], value[j], scales)
            product *= (1 - share) * usual + share * unusual
            if not 1 / _FAR_FROM_1 < product < _FAR_FROM_1:
                total += math.log(product)
                product = 1.0
        number = last - first
        total += math.log(product)
        found[owner] = total / max(number, 1) * min(number, config.INDEPENDENT_ROWS)
    return found


@compiled
def _find_inliers(odds: Array, valid: Mask, usual_share: float, inlier: Array) -> None:
    """Set the probabilities (M,) of a track's rows to be inliers, whose odds (M,) are given.

    Someone who stands through most of a track stands in the rest of it too, whatever the noise
    makes of it: the track has a share of outliers of its own.
    """
    number = valid.sum()
    share = usual_share
    for _ in range(config.OUTLIER_ROUNDS):
        left = float(number)
        for j in range(odds.size):
            if valid[j]:
                outlier = share * odds[j]
                inlier[j] = 1 - outlier / (outlier + 1 - share)
                left -= inlier[j]
        share = (config.OUTLIER_PRIOR_ROWS * usual_share + left) / (
            config.OUTLIER_PRIOR_ROWS + number
        )


@compiled
def _scales_of(
    total_sd: float, outliers: tuple[float, float, float]
) -> tuple[float, float, float, float, float]:
    """Reciprocals for densities, since a division takes as long as a root."""
    _, mean, sd = outliers
    return (
        1 / (total_sd * math.sqrt(config.FREEDOM)),
        0.375 / total_sd,  # the highest density of Student-t: 3/8
        mean,
        1 / (math.sqrt(2) * sd),
        1 / (math.sqrt(2 * math.pi) * sd),
    )


@compiled
def _densities(
    residual: float, value: float, scales: tuple[float, float, float, float, float]
) -> tuple[float, float]:
    """Of an inlier, Student-t of 4 degrees of freedom; of an outlier, normal."""
    per_scale, highest, mean, per_sd, highest_outlier = scales
    scaled, apart = residual * per_scale, (value - mean) * per_sd
    wide = 1 + scaled * scaled
    usual = highest / (wide * wide * math.sqrt(wide))
    return usual, highest_outlier * math.exp(-apart * apart)


@compiled
def _bounds_of(owner_idx: Index, owners: int) -> Index:
    """The first row of each track and the one after its last (N, 2); 0, 0 where it has none."""
    bounds = np.zeros((owners, 2), dtype=np.int64)
    for j in range(owner_idx.size):
        owner = owner_idx[j]
        if bounds[owner, 1] == 0:
            bounds[owner, 0] = j
        bounds[owner, 1] = j + 1
    return bounds


@compiled
def whitened(
    columns: Array,
    residual: Array,
    weight: Array,
    track: Array,
    owner_idx: Index,
    linked: Mask,
    when: Array,
    components: tuple[float, float, float, float],
) -> tuple[Array, Array]:
    """Rows of unit variance (M, P + 1), and what is lost of their moments (N, 2, P + 1).

    With the former W and the latter L of all tracks or one, W'W - L'L is what columns and residuals
    have in common once the tracks' own levels and trends are integrated out: L is the inverse root
    of the precision of level and trend, times the sums of W with those.

    Columns (M, P) are derivatives of the residuals (M,); `weight` (M,) is of rows, `track` (N,) of
    tracks; a `linked` row follows the one before it.

    Source: Prais and Winsten 1954, for a first-order autoregression.
    """
    between_sd, trend_sd, within_sd, rho = components
    count, width = columns.shape
    fresh_sd = math.sqrt(1 - rho**2) * within_sd
    white, lost = np.empty((count, width + 1)), np.zeros((track.size, 2, width + 1))
    one, mixed, square = 0.0, 0.0, 0.0
    for j in range(count):
        owner = owner_idx[j]
        of_level, of_trend = lost[owner]
        root = math.sqrt(weight[j])
        row = white[j]
        if linked[j]:
            here, back = root / fresh_sd, rho * math.sqrt(weight[j - 1]) / fresh_sd
            for c in range(width):
                row[c] = here * columns[j, c] - back * columns[j - 1, c]
            row[width] = here * residual[j] - back * residual[j - 1]
            level, trend = here - back, here * when[j] - back * when[j - 1]
        else:
            here = root / within_sd
            for c in range(width):
                row[c] = here * columns[j, c]
            row[width] = here * residual[j]
            level, trend = here, here * when[j]
        for c in range(width + 1):
            of_level[c] += level * row[c]
            of_trend[c] += trend * row[c]
        one, mixed, square = one + level * level, mixed + level * trend, square + trend * trend
        if j + 1 == count or owner_idx[j + 1] != owner:
            root_one = math.sqrt(one + track[owner] / between_sd**2)
            slant = mixed / root_one
            root_square = math.sqrt(square + 1 / trend_sd**2 - slant * slant)
            for c in range(width + 1):
                of_level[c] /= root_one
                of_trend[c] = (of_trend[c] - slant * of_level[c]) / root_square
            one, mixed, square = 0.0, 0.0, 0.0
    return white, lost


@compiled
def moments_of_tracks(white: Array, lost: Array, owner_idx: Index) -> Array:
    """W'W - L'L of each track (N, P + 1, P + 1), of rows (M, P + 1) and what is lost of them."""
    owners, _, width = lost.shape
    moments = np.zeros((owners, width, width))
    for owner in range(owners):
        for place in range(2):
            for c in range(width):
                for d in range(width):
                    moments[owner, c, d] -= lost[owner, place, c] * lost[owner, place, d]
    for j in range(len(white)):
        moment = moments[owner_idx[j]]
        for c in range(width):
            for d in range(width):
                moment[c, d] += white[j, c] * white[j, d]
    return moments
