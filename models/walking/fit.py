"""Gauss-Newton on one pose for all tracks, with the site's own mean as a nuisance.

The coefficients beta of the site's field are eliminated from the normal equations,
H = A - B C^-1 B', as a Schur complement.

Source: Triggs, McLauchlan, Hartley and Fitzgibbon 2000, Bundle Adjustment, for the elimination; the
weights of each round are those of `hierarchy`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from models.geometry.rotation import Array
from models.walking.direction_noise import corrected_covariance, noise_information
from models.walking.field import Field
from models.walking.measures import Measured
from models.walking.mixed_model import (
    FISHER,
    Curvature,
    Spread,
    Weights,
    composite_log_likelihoods,
    curvature,
    hierarchical_log_likelihood,
    relearn,
    reweigh,
    track_curvatures,
)

_MOST_ROUNDS = 40
_LEARNING_ROUNDS = 40
_LONGEST_MOVE = np.array([0.06, 0.06, 0.25])  # of one round, in tilt, roll, log height
_NEAR = 0.2  # of the longest move
_CONVERGED = 1e-5
_ROUGHLY = 0.1  # standard deviations: a round more moves it by some hundredths


@dataclass(frozen=True, slots=True, kw_only=True)
class Learned:
    """A field with the mean (P,) and covariance (P, P) of its coefficients, and the spread.

    `usual` is the field's mean over all that it was learned of.
    """

    field: Field
    mean: Array
    covariance: Array
    spread: Spread
    usual: float


class Measure(Protocol):
    """What some tracks show at a candidate (3,), with derivatives if it is `sloped`."""

    def __call__(self, *, candidate: Array, sloped: bool = True) -> Measured:
        """Measure."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Channel:
    """One kind of evidence: how to measure it at a candidate, and what is usual at the site."""

    measure: Measure
    learned: Learned


@dataclass(frozen=True, slots=True, kw_only=True)
class PosePrior:
    """A weak Gaussian on tilt, roll, log height: mean (3,) and standard deviations (3,)."""

    mean: Array
    sd: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class FitStart:
    """Where Gauss-Newton begins: `candidate` (3,), and the coefficients of the fields there.

    Without `means` they begin at what was learned. `warm` is where a fit of almost the same tracks
    ended: from there it ends once hardly anything moves.
    """

    candidate: Array
    means: tuple[Array, ...] = ()
    warm: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """Where Gauss-Newton ended: candidate (3,), covariance (3, 3) by the curvature less noise.

    `bound` (3, 3) is what no estimate by the same likelihood can beat (Cramer and Rao). `score`
    compares ends of different starts: the composite log likelihood, less the prior's penalty.
    `means` are the coefficients (P,) of each channel's field there.
    """

    candidate: Array
    covariance: Array
    bound: Array
    score: float
    means: tuple[Array, ...]

    @property
    def warm_start(self) -> FitStart:
        """Where a fit of almost the same tracks may begin."""
        return FitStart(candidate=self.candidate, means=self.means, warm=True)


def assumed(field: Field, spread: Spread) -> Learned:
    """A field that nothing has been learned of yet."""
    return Learned(
        field=field,
        mean=field.prior_mean,
        covariance=np.diag(field.prior_variance),
        spread=spread,
        usual=float(field.prior_mean[0]),
    )


def learn(measured: Measured, start: Learned, *, spread_rounds: int) -> Learned:
    """The field and the spread that explain what was measured at a known pose.

    The spread is learned anew so many times; with 0 it is taken as given.
    """
    spread = start.spread
    precision = np.linalg.inv(start.covariance)
    features = start.field.features(measured)
    mean, covariance = start.mean, start.covariance
    for round_ in range(spread_rounds + 1):
        for _ in range(_LEARNING_ROUNDS):
            residual = measured.value - features @ mean
            weights = reweigh(residual, measured.value, measured.valid, measured.rows, spread)
            sums = curvature(-features, residual, weights, measured.rows, spread)
            covariance = np.linalg.inv(sums.matrix + precision)
            move = -covariance @ (sums.gradient + precision @ (mean - start.mean))
            mean = mean + move
            if np.abs(features @ move).max(initial=0.0) < 1e-4:
                break
        if round_ < spread_rounds:
            residual = measured.value - features @ mean
            spread = relearn(
                residual, measured.value, measured.valid, measured.rows, weights, spread
            )
    inlier = weights.inlier
    return Learned(
        field=start.field,
        mean=mean,
        covariance=covariance,
        spread=spread,
        usual=float((inlier * (features @ mean)).sum() / max(float(inlier.sum()), 1e-9)),
    )


def held_out_log_likelihood(measured: Measured, learned: Learned) -> float:
    """The log likelihood, by a learned field, of what other tracks measured at the same pose."""
    residual = measured.value - learned.field.features(measured) @ learned.mean
    residual = np.where(measured.valid, residual, 0.0)
    rows, spread = measured.rows, learned.spread
    weights = reweigh(residual, measured.value, measured.valid, rows, spread)
    return hierarchical_log_likelihood(residual, weights, rows, spread)


def fit_pose(channels: Sequence[Channel], start: FitStart, prior: PosePrior) -> Fit:
    """Tilt, roll and log height, together with the fields' coefficients."""
    candidate = start.candidate.astype(np.float64)
    means: Sequence[Array] = start.means
    if len(means) != len(channels):
        means = [channel.learned.mean for channel in channels]
    precisions = [np.linalg.inv(channel.learned.covariance) for channel in channels]
    pose_precision = np.diag(prior.sd**-2.0)
    for _ in range(_MOST_ROUNDS):
        # Given the pose, the fields are independent: each is eliminated by itself.
        matrix = pose_precision.copy()
        gradient = pose_precision @ (candidate - prior.mean)
        noise = np.zeros((3, 3))
        solved = []
        for channel, mean, precision in zip(channels, means, precisions, strict=True):
            measured, jacobian, residual, weights = _linear(channel, candidate, mean)
            spread = channel.learned.spread
            sums = curvature(jacobian, residual, weights, measured.rows, spread)
            own = sums.matrix[3:, 3:] + precision
            own_gradient = sums.gradient[3:] + precision @ (mean - channel.learned.mean)
            cross = sums.matrix[:3, 3:]
            both = np.linalg.solve(own, np.column_stack([cross.T, own_gradient]))
            matrix += sums.matrix[:3, :3] - cross @ both[:, :3]
            gradient += sums.gradient[:3] - cross @ both[:, 3]
            noise += noise_information(measured, weights, spread)
            solved.append(both)
        move = -np.linalg.solve(matrix, gradient)
        far = float((np.abs(move) / _LONGEST_MOVE).max())
        # Near the end by the information of Student-t, which is less than its weights say: fewer
        # rounds by a half. Source: Lange, Little and Taylor 1989, scoring.
        share = FISHER if far < _NEAR else min(1.0, 1 / far)
        candidate = candidate + share * move
        means = [
            mean - share * (both[:, 3] + both[:, :3] @ move)
            for mean, both in zip(means, solved, strict=True)
        ]
        if np.abs(share * move).max() < _CONVERGED:
            break
        if start.warm and share * share * float(move @ matrix @ move) < _ROUGHLY**2:
            break
    score = -0.5 * float((((candidate - prior.mean) / prior.sd) ** 2).sum())
    for channel, mean in zip(channels, means, strict=True):
        score += float(_log_likelihoods(channel, candidate, mean).sum())
    return Fit(
        candidate=candidate,
        covariance=corrected_covariance(matrix, noise),
        bound=FISHER * np.asarray(np.linalg.inv(matrix)),
        score=score,
        means=tuple(means),
    )


def per_track(channels: Sequence[Channel], candidate: Array) -> Curvature:
    """Each track's own sums (N, 3, 3) and (N, 3) for tilt, roll, log height at a candidate."""
    each = []
    for channel in channels:
        learned = channel.learned
        measured, jacobian, residual, weights = _linear(channel, candidate, learned.mean)
        by_pose = jacobian[:, :3]
        each.append(track_curvatures(by_pose, residual, weights, measured.rows, learned.spread))
    return Curvature(
        matrix=np.sum([sums.matrix for sums in each], axis=0),
        gradient=np.sum([sums.gradient for sums in each], axis=0),
    )


def track_log_likelihoods(channels: Sequence[Channel], candidate: Array) -> Array:
    """The composite log likelihood (N,) of each track at a candidate."""
    each = [_log_likelihoods(channel, candidate, channel.learned.mean) for channel in channels]
    return np.asarray(np.sum(each, axis=0))


def _linear(
    channel: Channel, candidate: Array, mean: Array
) -> tuple[Measured, Array, Array, Weights]:
    """What is measured at a candidate, derivatives (M, 3 + P), residuals (M,) and weights."""
    measured = channel.measure(candidate=candidate)
    learned = channel.learned
    features = learned.field.features(measured)
    residual = np.where(measured.valid, measured.value - features @ mean, 0.0)
    weights = reweigh(residual, measured.value, measured.valid, measured.rows, learned.spread)
    jacobian = np.empty((residual.size, 3 + mean.size))
    slopes = learned.field.slopes(measured, features, mean)
    np.subtract(measured.d_value, slopes, out=jacobian[:, :3])
    np.negative(features, out=jacobian[:, 3:])
    return measured, jacobian, residual, weights


def _log_likelihoods(channel: Channel, candidate: Array, mean: Array) -> Array:
    measured = channel.measure(candidate=candidate, sloped=False)
    residual = measured.value - channel.learned.field.features(measured) @ mean
    return composite_log_likelihoods(
        residual, measured.value, measured.valid, measured.rows, channel.learned.spread
    )
