"""Rows of unit variance, and what the tracks' own levels and trends take of their sums.

The rows of a track stand together. The model is that of `mixed_model`.
"""

import math

import numpy as np
import numpy.typing as npt

from models.compiled import compiled
from models.geometry.rotation import Array, Mask


@compiled
def whitened(
    columns: Array,
    residual: Array,
    weight: Array,
    track: Array,
    owner_idx: npt.NDArray[np.int64],
    linked: Mask,
    when: Array,
    components: tuple[float, float, float, float],
) -> tuple[Array, Array]:
    """Rows of unit variance (M, P + 1), and what is lost of their moments (N, 2, P + 1).

    With the former W and the latter L of all tracks or one, W'W - L'L is what columns and residuals
    have in common once the tracks' own levels and trends are integrated out: L is the inverse root
    of the precision of level and trend, times the sums of W with those.

    Source: Prais and Winsten 1954, for a first-order autoregression.

    Args:
        columns: derivatives of the residuals (M, P).
        residual: of each row (M,).
        weight: of each row (M,).
        track: the weight of each track (N,).
        owner_idx: the track of each row (M,).
        linked: which rows follow the one before them (M,).
        when: since the middle of a row's track (M,), in 10 s.
        components: standard deviations between tracks, of trends, within tracks; the correlation.
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
def moments_of_tracks(white: Array, lost: Array, owner_idx: npt.NDArray[np.int64]) -> Array:
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


@compiled
def information_of_noise(
    noise: Array, weight: Array, valid: Mask, owner_idx: npt.NDArray[np.int64], owners: int
) -> Array:
    """Weighted squares (P, P) of rows (M, P), less what two degrees of freedom of a track take."""
    number = np.zeros(owners)
    for j in range(owner_idx.size):
        if valid[j]:
            number[owner_idx[j]] += 1
    width = noise.shape[1]
    squares = np.zeros((width, width))
    for j in range(owner_idx.size):
        of_track = number[owner_idx[j]]
        share = weight[j] * max(of_track - 2, 0) / max(of_track, 1)
        for c in range(width):
            for d in range(width):
                squares[c, d] += share * noise[j, c] * noise[j, d]
    return squares
