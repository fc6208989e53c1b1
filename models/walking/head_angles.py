"""Lean angles of people to the side at a candidate tilt and roll, and the angles that fit them.

A foot's ray f and its head's ray h span a plane through the camera, of normal n. An upright pole
lies in a plane with the vertical g, so n' g = 0 there; else n' g is the angle by which what stands
between f and h leans out of that plane, whatever its height and however far away it is.

Source: Hartley and Zisserman 2004, Multiple View Geometry, section 8.6, for the images of verticals
and their vanishing point; that the product is the lean itself is ours.

How people lean is the mixed model without trends, correlation and outliers: row j of track i leans
by y_ij = x_ij' beta + a_i + e_ij, what is usual (a detector's bias, and how people lean the way
they walk), the person's own, and a deviation. Gauss-Newton on tilt, roll and what is usual, weights
anew in every round; begun on a grid, since far from the truth everybody seems to be somebody else.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np

from models.geometry.ground import ground_of_rays, rotation_and_turns
from models.geometry.rotation import Array, Mask, aside_of, dot, norm
from models.tracks.observations import HeadFootPairs, Rows
from models.walking import config
from models.walking.mixed_model import (
    FISHER,
    Normal,
    VarianceComponents,
    curvature,
    regress,
    reweigh,
)

_LEAST_SPAN = 1e-9  # of the product of two rays that are one
_LEAST_WAY = 0.02  # of camera heights: who goes no farther stands


@dataclass(frozen=True, slots=True, kw_only=True)
class LeanAngles:
    """Leans (M,) at one candidate, radians, positive to the right in the picture.

    `jacobian` (M, 2) are derivatives by tilt and roll; `column` (M,) what the leans would be were
    the heads right above the feet in the picture; `sideways` (M,) how much of their way the people
    walk to the right, -1 to 1, 0 for those who stand. `valid` (M,): foot and head span a plane, and
    the foot is below the horizon; what is not is 0. `rows` say whose they are.
    """

    value: Array
    jacobian: Array
    column: Array
    sideways: Array
    valid: Mask
    rows: Rows


def measure_lean_angles(pairs: HeadFootPairs, angles: Array) -> LeanAngles:
    """The leans of people were the camera's tilt and roll (2,) those given."""
    rotation, turns = rotation_and_turns(float(angles[0]), float(angles[1]), 0.0)
    up = rotation[:, 2]
    normals, spanned = _normals(pairs.foot_rays, pairs.head_rays)
    columns, column_spanned = _normals(pairs.foot_rays, pairs.column_rays)
    foot, falls = ground_of_rays(pairs.foot_rays, rotation, beyond=0.0)
    valid = spanned & column_spanned & falls
    turned = np.stack([rotation @ turn[:, 2] for turn in turns], axis=1)
    return LeanAngles(
        value=np.where(valid, -normals @ up, 0.0),
        jacobian=np.where(valid[:, None], -normals @ turned, 0.0),
        column=np.where(valid, -columns @ up, 0.0),
        sideways=np.where(valid, _sideways(pairs, rotation, foot), 0.0),
        valid=valid,
        rows=_rows_of(pairs),
    )


def _rows_of(pairs: HeadFootPairs) -> Rows:
    """Rows in the middles of their tracks, where no trend is, and linked to none."""
    count = len(pairs)
    return Rows(
        owner_idx=pairs.owner_idx, linked=np.zeros(count, dtype=bool), time_s=np.zeros(count),
        when=np.zeros(count), owners=pairs.owners,
    )  # fmt: skip


def _normals(feet: Array, heads: Array) -> tuple[Array, Mask]:
    """Unit normals (M, 3) of the planes through rays, 0 where these are one, and where they are."""
    product = np.cross(feet, heads)
    length = norm(product)
    spanned = length > _LEAST_SPAN
    return product / np.where(spanned, length, np.inf)[:, None], spanned


def _sideways(pairs: HeadFootPairs, rotation: Array, foot: Array) -> Array:
    """The share (M,) of their walk on the ground to the right of the view of their feet."""
    start, start_falls = ground_of_rays(pairs.from_rays, rotation, beyond=0.0)
    end, end_falls = ground_of_rays(pairs.to_rays, rotation, beyond=0.0)
    way = np.where((start_falls & end_falls)[:, None], end - start, 0.0)
    length = norm(way)
    right = -aside_of(foot)
    across = dot(way, right) / np.maximum(length * norm(right), 1e-12)
    return np.asarray(np.where(length > _LEAST_WAY, across, 0.0))


_TILT_LIMIT = np.radians(89.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class LeanComponents:
    """Standard deviations of leans in radians: between people, and within one."""

    between_sd: float
    within_sd: float

    @property
    def mixed(self) -> VarianceComponents:
        """The same for the mixed model, without correlation and outliers."""
        return VarianceComponents(
            between_sd=self.between_sd, trend_sd=1.0, within_sd=self.within_sd, correlation=0.0,
            outlier_share=0.0, outlier_mean=0.0, outlier_sd=1.0,
        )  # fmt: skip


def learn_habit(
    pairs: HeadFootPairs, at: Array, components: LeanComponents, *, rounds: int
) -> tuple[Normal, LeanComponents]:
    """The usual leans at a known tilt and roll (2,), and how they scatter.

    The components are learned in so many rounds of EM; with 0 they are taken as given.
    """
    leans = measure_lean_angles(pairs, at)
    features = _features(leans)
    prior = Normal(mean=np.zeros(2), covariance=np.diag(config.HABIT_SD**2))
    for _ in range(rounds):
        found = _regressed(features, leans, prior, components)
        components = _em_step(leans.value - features @ found.mean, leans, components)
    return _regressed(features, leans, prior, components), components


def column_share(
    pairs: HeadFootPairs, at: Array, components: LeanComponents
) -> tuple[float, float]:
    """The share by which heads follow the picture's columns at a tilt and roll (2,), and its sd.

    0 is where leans are the same all over the picture, 1 where heads are right above the feet in
    it. Where columns are as upright as verticals are, or as oblique everywhere, nobody can tell,
    and the standard deviation is 1.
    """
    leans = measure_lean_angles(pairs, at)
    features = np.column_stack([_features(leans), leans.column])
    sd = np.append(config.HABIT_SD, config.COLUMN_SHARE_SD)
    prior = Normal(mean=np.zeros(3), covariance=np.diag(sd**2))
    found = _regressed(features, leans, prior, components)
    return float(found.mean[2]), float(np.sqrt(found.covariance[2, 2]))


def fit_angles(
    pairs: HeadFootPairs, near: Array, habit: Normal, components: LeanComponents
) -> Normal:
    """Tilt and roll (2,) by heads, with the curvature's covariance (2, 2).

    The search is around `near` (2,), 24 deg either way; `habit` is of the usual leans at the site.
    """
    angles = _start(pairs, near, habit, components)
    coefficients, mixed = habit.mean, components.mixed
    precision = np.zeros((4, 4))
    precision[:2, :2] = np.eye(2) / config.HEAD_ANGLE_SD**2
    precision[2:, 2:] = np.linalg.inv(habit.covariance)
    for _ in range(config.MOST_ROUNDS):
        leans = measure_lean_angles(pairs, angles)
        features = _features(leans)
        residual = np.where(leans.valid, leans.value - features @ coefficients, 0.0)
        jacobian = np.column_stack([leans.jacobian, -features])
        weights = reweigh(residual, leans, mixed)
        sums = curvature(jacobian, residual, weights, leans.rows, mixed)
        matrix = sums.matrix + precision
        off = np.concatenate([angles - near, coefficients - habit.mean])
        move = -np.linalg.solve(matrix, sums.gradient + precision @ off)
        move = move * min(1.0, config.HEAD_LONGEST_MOVE / max(float(np.abs(move).max()), 1e-12))
        angles = np.clip(angles + move[:2], (-_TILT_LIMIT, -np.inf), (_TILT_LIMIT, np.inf))
        coefficients = coefficients + move[2:]
        if np.abs(move).max() < config.HEAD_CONVERGED:
            break
    return Normal(mean=angles, covariance=np.asarray(FISHER * np.linalg.inv(matrix)[:2, :2]))


def _start(pairs: HeadFootPairs, near: Array, habit: Normal, components: LeanComponents) -> Array:
    """The tilt and roll (2,) of a grid of which a few tracks are the likeliest."""
    tracks = pairs.tracks
    count = min(config.HEAD_START_TRACKS, tracks.size)
    chosen = np.linspace(0, tracks.size - 1, count).astype(np.int64)
    few = pairs.of_tracks(tracks[np.unique(chosen)])
    best, found = -np.inf, near
    for tilt, roll in product(config.HEAD_GRID_RAD, config.HEAD_GRID_RAD):
        angles = near + (tilt, roll)
        if abs(angles[0]) > _TILT_LIMIT:
            continue
        leans = measure_lean_angles(few, angles)
        # A foot above the horizon is no foot: as unlikely as one that lies.
        residual = np.where(leans.valid, leans.value - _features(leans) @ habit.mean, 1.0)
        likely = _log_likelihood(residual, few, components)
        if likely > best:
            best, found = likely, angles
    return np.asarray(found)


def _features(leans: LeanAngles) -> Array:
    """The features (M, 2) of usual leans: always, and how far somebody walks to the right."""
    return np.column_stack([np.ones(len(leans.value)), leans.sideways]) * leans.valid[:, None]


def _regressed(
    features: Array, leans: LeanAngles, prior: Normal, components: LeanComponents
) -> Normal:
    """The coefficients (P,) of features (M, P) that explain leans."""
    found, _ = regress(
        features, leans, components.mixed, prior, prior.mean,
        lambda move: bool(np.abs(move).max() < config.HEAD_CONVERGED),
    )  # fmt: skip
    return Normal(mean=found.mean, covariance=FISHER * found.covariance)


def _em_step(residual: Array, leans: LeanAngles, components: LeanComponents) -> LeanComponents:
    """The components that explain residuals (M,) best.

    Few rows of a person tell their own lean: its variance counts, which the mixed model's own step
    leaves out.
    """
    rows, mixed = leans.rows, components.mixed
    weights = reweigh(residual, leans, mixed)
    after = reweigh(residual, leans, mixed, config.WEIGHT_ROUNDS + 1)  # effects by these weights
    effect, variance = after.effects[:, 0], after.effect_covariance[:, 0, 0]
    squared = (residual - effect[rows.owner_idx]) ** 2 + variance[rows.owner_idx]
    within = float((weights.row * squared).sum()) / max(float(leans.valid.sum()), 1.0)
    seen = np.unique(rows.owner_idx)
    between = float((weights.track * (effect**2 + variance))[seen].mean())
    return LeanComponents(
        between_sd=max(float(np.sqrt(between)), config.LEAST_LEAN_SD),
        within_sd=max(float(np.sqrt(within)), config.LEAST_LEAN_SD),
    )


def _log_likelihood(residual: Array, pairs: HeadFootPairs, components: LeanComponents) -> float:
    """About how likely residuals (M,) are, each track by the mean of its rows; for comparing."""
    number = np.bincount(pairs.owner_idx, minlength=pairs.owners)
    mean = np.bincount(pairs.owner_idx, residual, pairs.owners) / np.maximum(number, 1)
    variance = components.between_sd**2 + components.within_sd**2
    return float(-(config.FREEDOM + 1) / 2 * np.log1p(mean**2 / variance / config.FREEDOM).sum())
