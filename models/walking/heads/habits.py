"""How people lean: a small robust linear mixed model of their leans, by re-weighting and EM.

Row j of track i leans by y_ij = x_ij' beta + a_i + e_ij: what is usual (a detector's bias, and how
people lean the way they walk), the person's own, and a deviation, both Student-t. Given the weights
it is a Gaussian mixed model whose a_i are integrated out.

Source: Laird and Ware 1982 for the mixed model and its EM; Lange, Little and Taylor 1989 for the
Student-t's weights, (nu + 1) / (nu + u^2), and what its curvature overstates, (nu + 3) / (nu + 1),
at 4 degrees of freedom.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from models.geometry.rotation import Array, Mask

_FREEDOM = 4.0
FISHER = (_FREEDOM + 3) / (_FREEDOM + 1)
_WEIGHT_ROUNDS = 3
_LEAST_SD = 1e-3  # a tenth of a degree or less: not even a drawing is as upright


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """Standard deviations of leans in radians: between people, and within one."""

    between_sd: float
    within_sd: float


ASSUMED_SPREAD = Spread(between_sd=0.03, within_sd=0.04)


@dataclass(frozen=True, slots=True, kw_only=True)
class Normal:
    """A normal distribution: mean (P,) and covariance (P, P)."""

    mean: Array
    covariance: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Sums:
    """Gauss-Newton sums over all people: matrix (P, P), gradient (P,); rows and their own leans.

    `row` (M,) and `track` (N,) are the Student-t's weights, `own` (N,) the people's own leans with
    variances `own_variance` (N,).
    """

    matrix: Array
    gradient: Array
    row: Array
    track: Array
    own: Array
    own_variance: Array


def sums_of(
    jacobian: Array,
    residual: Array,
    valid: Mask,
    owner_idx: npt.NDArray[np.int64],
    spread: Spread,
) -> Sums:
    """The sums for residuals (M,) of derivatives (M, P), rows of a track beside one another."""
    tracks, inverse = np.unique(owner_idx, return_inverse=True)
    count = tracks.size
    row = valid / spread.within_sd**2
    track, own = np.ones(count), np.zeros(count)
    for _ in range(_WEIGHT_ROUNDS):
        held = np.bincount(inverse, row, count) + track / spread.between_sd**2
        own = np.bincount(inverse, row * residual, count) / held
        track = (_FREEDOM + 1) / (_FREEDOM + (own / spread.between_sd) ** 2)
        doubt = (residual - own[inverse]) / spread.within_sd
        row = valid * (_FREEDOM + 1) / (_FREEDOM + doubt**2) / spread.within_sd**2
    held = np.bincount(inverse, row, count) + track / spread.between_sd**2
    both = np.column_stack([jacobian, residual])
    weighted = both * row[:, None]
    by_track = np.zeros((count, both.shape[1]))
    np.add.at(by_track, inverse, weighted)
    moment = weighted.T @ both - (by_track / held[:, None]).T @ by_track
    return Sums(
        matrix=moment[:-1, :-1],
        gradient=moment[:-1, -1],
        row=row * spread.within_sd**2,
        track=track,
        own=by_track[:, -1] / held,
        own_variance=1 / held,
    )


def relearned(residual: Array, valid: Mask, owner_idx: npt.NDArray[np.int64], sums: Sums) -> Spread:
    """The spread that explains residuals (M,) best, by one round of EM."""
    _, inverse = np.unique(owner_idx, return_inverse=True)
    apart = (residual - sums.own[inverse]) ** 2 + sums.own_variance[inverse]
    within = float((sums.row * apart).sum()) / max(float(valid.sum()), 1.0)
    between = float((sums.track * (sums.own**2 + sums.own_variance)).mean())
    return Spread(
        between_sd=max(float(np.sqrt(between)), _LEAST_SD),
        within_sd=max(float(np.sqrt(within)), _LEAST_SD),
    )


def log_likelihood(
    residual: Array, valid: Mask, owner_idx: npt.NDArray[np.int64], spread: Spread
) -> float:
    """About how likely residuals (M,) are, each track by the mean of its rows; for comparing."""
    tracks, inverse = np.unique(owner_idx, return_inverse=True)
    number = np.bincount(inverse, valid, tracks.size)
    mean = np.bincount(inverse, valid * residual, tracks.size) / np.maximum(number, 1)
    variance = spread.between_sd**2 + spread.within_sd**2
    density = -(_FREEDOM + 1) / 2 * np.log1p(mean**2 / variance / _FREEDOM)
    return float(np.where(number > 0, density, 0.0).sum())
