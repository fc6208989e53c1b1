"""Gauss-Newton on one pose for all tracks, with the site's own mean as a nuisance.

The coefficients beta of the site's field are eliminated from the normal equations,
H = A - B C^-1 B', as a Schur complement.

Source: Triggs, McLauchlan, Hartley and Fitzgibbon 2000, Bundle Adjustment, for the elimination; the
weights of each round are those of `mixed_model`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from models.geometry.rotation import Array
from models.serialization import stored_as
from models.walking import config
from models.walking.direction_noise import corrected_covariance, noise_information
from models.walking.field import Field
from models.walking.measures import Measured
from models.walking.mixed.model import (
    FISHER,
    Curvature,
    Normal,
    VarianceComponents,
    Weights,
    composite_log_likelihoods,
    curvature,
    em_step,
    h_log_likelihood,
    regress,
    reweigh,
    track_curvatures,
)

_NEAR = 0.2  # of the longest move: from there on by the information of Student-t
_FIELD_SETTLED = 1e-4  # of a log at any row


@dataclass(frozen=True, slots=True, kw_only=True)
class Learned:
    """A field with the mean (P,) and covariance (P, P) of its coefficients.

    `components` are of variance; `usual` is the field's mean over all that it was learned of.
    """

    field: Field
    mean: Array
    covariance: Array
    components: VarianceComponents = stored_as("spread")
    usual: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Channel:
    """One kind of evidence: its measurements at a candidate, and what is usual at the site.

    `measure` takes a `candidate` (3,) and whether it is to be `sloped`, with derivatives, as usual.
    """

    measure: Callable[..., Measured]
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
    """The end of Gauss-Newton: candidate (3,), covariance (3, 3) by the curvature less noise.

    `bound` (3, 3) is what no estimate by the same likelihood can beat (Cramer and Rao).
    `log_likelihood` compares ends of different starts: the composite one, less the prior's penalty.
    `means` are the coefficients (P,) of each channel's field there.
    """

    candidate: Array
    covariance: Array
    bound: Array
    log_likelihood: float
    means: tuple[Array, ...]

    @property
    def warm_start(self) -> FitStart:
        """The start of a fit of almost the same tracks."""
        return FitStart(candidate=self.candidate, means=self.means, warm=True)


def assumed(field: Field, components: VarianceComponents) -> Learned:
    """A field that nothing has been learned of yet."""
    return Learned(
        field=field,
        mean=field.prior_mean,
        covariance=np.diag(field.prior_variance),
        components=components,
        usual=float(field.prior_mean[0]),
    )


def learn(measured: Measured, start: Learned, *, em_rounds: int) -> Learned:
    """The field and the components that explain what was measured at a known pose.

    The components are learned in so many rounds of EM; with 0 they are taken as given.
    """
    features, components = start.field.features(measured), start.components
    prior = Normal(mean=start.mean, covariance=start.covariance)
    found = prior
    for round_ in range(em_rounds + 1):
        found, weights = regress(
            features, measured, components, prior, found.mean,
            lambda move: bool(np.abs(features @ move).max(initial=0.0) < _FIELD_SETTLED),
        )  # fmt: skip
        if round_ < em_rounds:
            residual = measured.value - features @ found.mean
            components = em_step(residual, measured, weights, components)
    inlier = weights.inlier
    return Learned(
        field=start.field,
        mean=found.mean,
        covariance=found.covariance,
        components=components,
        usual=float((inlier * (features @ found.mean)).sum() / max(float(inlier.sum()), 1e-9)),
    )


def held_out_log_likelihood(measured: Measured, learned: Learned) -> float:
    """The log likelihood, by a learned field, of what other tracks measured at the same pose."""
    residual = measured.value - learned.field.features(measured) @ learned.mean
    residual = np.where(measured.valid, residual, 0.0)
    weights = reweigh(residual, measured, learned.components)
    return h_log_likelihood(residual, weights, measured.rows, learned.components)


def fit_pose(channels: Sequence[Channel], start: FitStart, prior: PosePrior) -> Fit:
    """Tilt, roll and log height, together with the fields' coefficients."""
    candidate = start.candidate.astype(np.float64)
    means: Sequence[Array] = start.means
    if len(means) != len(channels):
        means = [channel.learned.mean for channel in channels]
    precisions = [np.linalg.inv(channel.learned.covariance) for channel in channels]
    pose_precision = np.diag(prior.sd**-2.0)
    for _ in range(config.MOST_ROUNDS):
        # Given the pose, the fields are independent: each is eliminated by itself.
        matrix = pose_precision.copy()
        gradient = pose_precision @ (candidate - prior.mean)
        noise = np.zeros((3, 3))
        solved = []
        for channel, mean, precision in zip(channels, means, precisions, strict=True):
            measured, jacobian, residual, weights = _linear(channel, candidate, mean)
            components = channel.learned.components
            sums = curvature(jacobian, residual, weights, measured.rows, components)
            own = sums.matrix[3:, 3:] + precision
            own_gradient = sums.gradient[3:] + precision @ (mean - channel.learned.mean)
            cross = sums.matrix[:3, 3:]
            both = np.linalg.solve(own, np.column_stack([cross.T, own_gradient]))
            matrix += sums.matrix[:3, :3] - cross @ both[:, :3]
            gradient += sums.gradient[:3] - cross @ both[:, 3]
            noise += noise_information(measured, weights, components)
            solved.append(both)
        move = -np.linalg.solve(matrix, gradient)
        far = float((np.abs(move) / config.LONGEST_MOVE).max())
        # Near the end by the information of Student-t, which is less than its weights say: fewer
        # rounds by a half. Source: Lange, Little and Taylor 1989, scoring.
        share = FISHER if far < _NEAR else min(1.0, 1 / far)
        candidate = candidate + share * move
        means = [
            mean - share * (both[:, 3] + both[:, :3] @ move)
            for mean, both in zip(means, solved, strict=True)
        ]
        if np.abs(share * move).max() < config.CONVERGED:
            break
        if start.warm and share * share * float(move @ matrix @ move) < config.ROUGHLY**2:
            break
    log_likelihood = -0.5 * float((((candidate - prior.mean) / prior.sd) ** 2).sum())
    for channel, mean in zip(channels, means, strict=True):
        log_likelihood += float(_log_likelihoods(channel, candidate, mean).sum())
    return Fit(
        candidate=candidate,
        covariance=corrected_covariance(matrix, noise),
        bound=FISHER * np.asarray(np.linalg.inv(matrix)),
        log_likelihood=log_likelihood,
        means=tuple(means),
    )


def per_track(channels: Sequence[Channel], candidate: Array) -> Curvature:
    """Each track's own sums (N, 3, 3) and (N, 3) for tilt, roll, log height at a candidate."""
    each = []
    for channel in channels:
        learned = channel.learned
        measured, jacobian, residual, weights = _linear(channel, candidate, learned.mean)
        by_pose = jacobian[:, :3]
        components = learned.components
        each.append(track_curvatures(by_pose, residual, weights, measured.rows, components))
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
    """Measurements at a candidate, derivatives (M, 3 + P), residuals (M,) and weights."""
    measured = channel.measure(candidate=candidate)
    learned = channel.learned
    features = learned.field.features(measured)
    residual = np.where(measured.valid, measured.value - features @ mean, 0.0)
    weights = reweigh(residual, measured, learned.components)
    jacobian = np.empty((residual.size, 3 + mean.size))
    slopes = learned.field.slopes(measured, features, mean)
    np.subtract(measured.d_value, slopes, out=jacobian[:, :3])
    np.negative(features, out=jacobian[:, 3:])
    return measured, jacobian, residual, weights


def _log_likelihoods(channel: Channel, candidate: Array, mean: Array) -> Array:
    measured = channel.measure(candidate=candidate, sloped=False)
    residual = measured.value - channel.learned.field.features(measured) @ mean
    return composite_log_likelihoods(residual, measured, channel.learned.components)
