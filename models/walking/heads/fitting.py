"""Tilt and roll by heads above feet, whatever they were before, and what heads are above.

Gauss-Newton on tilt, roll and what is usual of leans, weights anew in every round; begun on a grid,
since far from the truth everybody seems to be somebody else.
"""

from itertools import product

import numpy as np

from models.geometry.rotation import Array
from models.tracks.head_foot import Uprights
from models.walking.heads.habits import FISHER, Normal, Spread, log_likelihood, relearned, sums_of
from models.walking.heads.lean_angles import Leans, measure_leans

_ROUNDS = 40
_CONVERGED = 1e-6
_LONGEST_MOVE = 0.06
_HOLD_SD = 1.0  # of tilt and roll, in radians: of what heads leave free all is left free
_GRID_RAD = np.radians(np.arange(-24.0, 25.0, 8.0))
_START_TRACKS = 60
_TILT_LIMIT = np.radians(89.0)
UNKNOWN_HABIT_SD = np.radians([4.0, 4.0])  # of a detector's bias, and of the lean of who walks
_SHARE_SD = 1.0  # of the share of columns before any head is seen


def learn_habit(
    uprights: Uprights, at: Array, spread: Spread, *, rounds: int
) -> tuple[Normal, Spread]:
    """What is usual of leans at a known tilt and roll (2,).

    The spread is learned anew so many times; with 0 it is taken as given.
    """
    leans = measure_leans(uprights, at)
    features = _features(leans)
    habit = Normal(mean=np.zeros(2), covariance=np.diag(UNKNOWN_HABIT_SD**2))
    for _ in range(rounds):
        found = _solved(features, leans, uprights, habit, spread)
        residual = leans.value - features @ found.mean
        sums = sums_of(features, residual, leans.valid, uprights.owner_idx, spread)
        spread = relearned(residual, leans.valid, uprights.owner_idx, sums)
    return _solved(features, leans, uprights, habit, spread), spread


def column_share(uprights: Uprights, at: Array, spread: Spread) -> tuple[float, float]:
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
    found = _solved(features, leans, uprights, prior, spread)
    return float(found.mean[2]), float(np.sqrt(found.covariance[2, 2]))


def fit_angles(uprights: Uprights, near: Array, habit: Normal, spread: Spread) -> Normal:
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
        sums = sums_of(jacobian, residual, leans.valid, uprights.owner_idx, spread)
        matrix = sums.matrix + precision
        off = np.concatenate([angles - near, coefficients - habit.mean])
        move = -np.linalg.solve(matrix, sums.gradient + precision @ off)
        move = move * min(1.0, _LONGEST_MOVE / max(float(np.abs(move).max()), 1e-12))
        angles = np.clip(angles + move[:2], (-_TILT_LIMIT, -np.inf), (_TILT_LIMIT, np.inf))
        coefficients = coefficients + move[2:]
        if np.abs(move).max() < _CONVERGED:
            break
    return Normal(mean=angles, covariance=np.asarray(FISHER * np.linalg.inv(matrix)[:2, :2]))


def _start(uprights: Uprights, near: Array, habit: Normal, spread: Spread) -> Array:
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
        likely = log_likelihood(residual, np.ones(len(few), bool), few.owner_idx, spread)
        if likely > best:
            best, found = likely, angles
    return np.asarray(found)


def _features(leans: Leans) -> Array:
    """What is usual depends on these (M, 2): always, and how far somebody walks to the right."""
    return np.column_stack([np.ones(len(leans.value)), leans.sideways]) * leans.valid[:, None]


def _solved(
    features: Array, leans: Leans, uprights: Uprights, prior: Normal, spread: Spread
) -> Normal:
    """The coefficients (P,) of features (M, P) that explain leans."""
    precision = np.linalg.inv(prior.covariance)
    mean = prior.mean
    for _ in range(_ROUNDS):
        residual = leans.value - features @ mean
        sums = sums_of(-features, residual, leans.valid, uprights.owner_idx, spread)
        matrix = sums.matrix + precision
        move = -np.linalg.solve(matrix, sums.gradient + precision @ (mean - prior.mean))
        mean = mean + move
        if np.abs(move).max() < _CONVERGED:
            break
    return Normal(mean=mean, covariance=FISHER * np.linalg.inv(matrix))
