"""Tilt and roll by heads above feet, whatever they were before, and what heads are above.

How people lean is the mixed model without trends, correlation and outliers: row j of track i leans
by y_ij = x_ij' beta + a_i + e_ij, what is usual (a detector's bias, and how people lean the way
they walk), the person's own, and a deviation. Gauss-Newton on tilt, roll and what is usual, weights
anew in every round; begun on a grid, since far from the truth everybody seems to be somebody else.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np

from models.geometry.rotation import Array, Mask
from models.tracks.head_foot import Uprights
from models.tracks.observations import Rows
from models.walking.heads.lean_angles import Leans, measure_leans
from models.walking.loops.weights import FREEDOM
from models.walking.mixed_model import (
    FISHER,
    Curvature,
    Normal,
    Spread,
    curvature,
    regress,
    reweigh,
)

_ROUNDS = 40
_CONVERGED = 1e-6
_LONGEST_MOVE = 0.06
_HOLD_SD = 1.0  # of tilt and roll, in radians: of what heads leave free all is left free
_GRID_RAD = np.radians(np.arange(-24.0, 25.0, 8.0))
_START_TRACKS = 60
_TILT_LIMIT = np.radians(89.0)
UNKNOWN_HABIT_SD = np.radians([4.0, 4.0])  # of a detector's bias, and of the lean of who walks
_SHARE_SD = 1.0  # of the share of columns before any head is seen
_LEAST_SD = 1e-3  # a tenth of a degree or less: not even a drawing is as upright


@dataclass(frozen=True, slots=True, kw_only=True)
class LeanSpread:
    """Standard deviations of leans in radians: between people, and within one."""

    between_sd: float
    within_sd: float

    @property
    def mixed(self) -> Spread:
        """The same for the mixed model, without correlation and outliers."""
        return Spread(
            between_sd=self.between_sd, trend_sd=1.0, within_sd=self.within_sd, correlation=0.0,
            outlier_share=0.0, outlier_mean=0.0, outlier_sd=1.0,
        )  # fmt: skip


ASSUMED_SPREAD = LeanSpread(between_sd=0.03, within_sd=0.04)


def learn_habit(
    uprights: Uprights, at: Array, spread: LeanSpread, *, rounds: int
) -> tuple[Normal, LeanSpread]:
    """What is usual of leans at a known tilt and roll (2,).

    The spread is learned anew so many times; with 0 it is taken as given.
    """
    leans = measure_leans(uprights, at)
    features = _features(leans)
    prior = Normal(mean=np.zeros(2), covariance=np.diag(UNKNOWN_HABIT_SD**2))
    for _ in range(rounds):
        found = _regressed(features, leans, uprights, prior, spread)
        spread = _relearned(leans.value - features @ found.mean, leans.valid, uprights, spread)
    return _regressed(features, leans, uprights, prior, spread), spread


def column_share(uprights: Uprights, at: Array, spread: LeanSpread) -> tuple[float, float]:
    """How far heads follow the picture's columns at a tilt and roll (2,), give or take one sd.

    0 is where leans are the same all over the picture, 1 where heads are right above the feet in
    it. Where columns are as upright as verticals are, or as oblique everywhere, nobody can tell,
    and the standard deviation is 1.
    """
    leans = measure_leans(uprights, at)
    features = np.column_stack([_features(leans), leans.column])
    prior = Normal(
        mean=np.zeros(3), covariance=np.diag(np.append(UNKNOWN_HABIT_SD, _SHARE_SD) ** 2)
    )
    found = _regressed(features, leans, uprights, prior, spread)
    return float(found.mean[2]), float(np.sqrt(found.covariance[2, 2]))


def fit_angles(uprights: Uprights, near: Array, habit: Normal, spread: LeanSpread) -> Normal:
    """Tilt and roll (2,) by heads, with the curvature's covariance (2, 2).

    Args:
        uprights: of the tracks.
        near: tilt and roll (2,) that the search is around, 24 deg either way.
        habit: what is usual of leans at the site.
        spread: of leans.
    """
    angles = _start(uprights, near, habit, spread)
    coefficients = habit.mean
    precision = np.zeros((4, 4))
    precision[:2, :2] = np.eye(2) / _HOLD_SD**2
    precision[2:, 2:] = np.linalg.inv(habit.covariance)
    for _ in range(_ROUNDS):
        leans = measure_leans(uprights, angles)
        features = _features(leans)
        residual = np.where(leans.valid, leans.value - features @ coefficients, 0.0)
        jacobian = np.column_stack([leans.jacobian, -features])
        sums = _sums(jacobian, residual, leans.valid, uprights, spread)
        matrix = sums.matrix + precision
        off = np.concatenate([angles - near, coefficients - habit.mean])
        move = -np.linalg.solve(matrix, sums.gradient + precision @ off)
        move = move * min(1.0, _LONGEST_MOVE / max(float(np.abs(move).max()), 1e-12))
        angles = np.clip(angles + move[:2], (-_TILT_LIMIT, -np.inf), (_TILT_LIMIT, np.inf))
        coefficients = coefficients + move[2:]
        if np.abs(move).max() < _CONVERGED:
            break
    return Normal(mean=angles, covariance=np.asarray(FISHER * np.linalg.inv(matrix)[:2, :2]))


def _start(uprights: Uprights, near: Array, habit: Normal, spread: LeanSpread) -> Array:
    """The tilt and roll (2,) of a grid of which a few tracks are the likeliest."""
    tracks = uprights.tracks
    chosen = np.linspace(0, tracks.size - 1, min(_START_TRACKS, tracks.size)).astype(np.int64)
    few = uprights.of_tracks(tracks[np.unique(chosen)])
    best, found = -np.inf, near
    for tilt, roll in product(_GRID_RAD, _GRID_RAD):
        angles = near + (tilt, roll)
        if abs(angles[0]) > _TILT_LIMIT:
            continue
        leans = measure_leans(few, angles)
        # A foot above the horizon is no foot: as unlikely as one that lies.
        residual = np.where(leans.valid, leans.value - _features(leans) @ habit.mean, 1.0)
        likely = _log_likelihood(residual, few, spread)
        if likely > best:
            best, found = likely, angles
    return np.asarray(found)


def _features(leans: Leans) -> Array:
    """What is usual depends on these (M, 2): always, and how far somebody walks to the right."""
    return np.column_stack([np.ones(len(leans.value)), leans.sideways]) * leans.valid[:, None]


def _regressed(
    features: Array, leans: Leans, uprights: Uprights, prior: Normal, spread: LeanSpread
) -> Normal:
    """The coefficients (P,) of features (M, P) that explain leans."""
    found, _ = regress(
        features, leans.value, leans.valid, _rows_of(uprights), spread.mixed, prior, prior.mean,
        lambda move: bool(np.abs(move).max() < _CONVERGED),
    )  # fmt: skip
    return Normal(mean=found.mean, covariance=FISHER * found.covariance)


def _sums(
    jacobian: Array, residual: Array, valid: Mask, uprights: Uprights, spread: LeanSpread
) -> Curvature:
    rows, mixed = _rows_of(uprights), spread.mixed
    weights = reweigh(residual, residual, valid, rows, mixed)
    return curvature(jacobian, residual, weights, rows, mixed)


def _rows_of(uprights: Uprights) -> Rows:
    """Rows in the middles of their tracks, where no trend is, and linked to none."""
    count = len(uprights)
    return Rows(
        owner_idx=uprights.owner_idx, linked=np.zeros(count, dtype=bool), time_s=np.zeros(count),
        when=np.zeros(count), owners=uprights.owners,
    )  # fmt: skip


def _relearned(residual: Array, valid: Mask, uprights: Uprights, spread: LeanSpread) -> LeanSpread:
    """The spread that explains residuals (M,) best, by one round of EM.

    Few rows of a person tell their own lean: its variance counts, which `relearn` leaves out.
    """
    rows, mixed = _rows_of(uprights), spread.mixed
    weights = reweigh(residual, residual, valid, rows, mixed)
    after = reweigh(residual, residual, valid, rows, mixed, rounds=4)  # own leans by these weights
    own, variance = after.own[:, 0], after.own_covariance[:, 0, 0]
    apart = (residual - own[rows.owner_idx]) ** 2 + variance[rows.owner_idx]
    within = float((weights.row * apart).sum()) / max(float(valid.sum()), 1.0)
    between = float((weights.track * (own**2 + variance))[uprights.tracks].mean())
    return LeanSpread(
        between_sd=max(float(np.sqrt(between)), _LEAST_SD),
        within_sd=max(float(np.sqrt(within)), _LEAST_SD),
    )


def _log_likelihood(residual: Array, uprights: Uprights, spread: LeanSpread) -> float:
    """About how likely residuals (M,) are, each track by the mean of its rows; for comparing."""
    number = np.bincount(uprights.owner_idx, minlength=uprights.owners)
    mean = np.bincount(uprights.owner_idx, residual, uprights.owners) / np.maximum(number, 1)
    variance = spread.between_sd**2 + spread.within_sd**2
    return float(-(FREEDOM + 1) / 2 * np.log1p(mean**2 / variance / FREEDOM).sum())
