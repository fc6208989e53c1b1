"""Gauss-Newton on one pose for all tracks, with the site's own mean as a nuisance.

The coefficients beta of the site's field are eliminated from the normal equations,
H = A - B C^-1 B', as a Schur complement.

Source: Triggs, McLauchlan, Hartley and Fitzgibbon 2000, Bundle Adjustment, for the elimination; the
weights of each round are those of `mixed_model`.

It starts at the best poses of a coarse look at all in reach, so that one bad start cannot fool us:
at each tilt and roll of a grid, log height = usual log speed - quantile of log speed at height 1
(ours).

A direction's noise is in the derivative of a step's log speed by the pose, and there its square
looks like information. Where people walk many ways it is a few per cent of what there is; on a
single path, where there is hardly any, it would make sure of a pose that is not identifiable.
Measured that way, 240 tracks of one path were 13 deg off in tilt and gave 1 deg as its deviation.

Source: Fuller 1987, Measurement Error Models: of regressors with noise of a known covariance the
moments less that noise, (M - N)^-1 M (M - N)^-1. What N is, and that at most 95 % of M are called
noise, is ours.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.compiled import compiled
from models.geometry.pose import CameraPose, plane_parameters_of
from models.geometry.rotation import Array, Index, Mask
from models.walking import config
from models.walking.field import Learned
from models.walking.measures import Measured
from models.walking.mixed_model import (
    FISHER,
    Curvature,
    Normal,
    VarianceComponents,
    Weights,
    composite_log_likelihoods,
    curvature,
    reweigh,
    track_curvatures,
)

_NEAR = 0.2  # of the longest move: from there on a share may be more than all of it
_SHARES = 0.25, 4.0  # of a move


@dataclass(frozen=True, slots=True, kw_only=True)
class Channel:
    """One kind of evidence: its measurements at a candidate, and what is usual at the site.

    `measure` takes a `candidate` (3,) and whether it is to be `sloped`, with derivatives, as usual.
    """

    measure: Callable[..., Measured]
    learned: Learned


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


def fit_pose(channels: Sequence[Channel], start: FitStart, prior: CameraPose | Normal) -> Fit:
    """Tilt, roll and log height, together with the fields' coefficients.

    A weak Gaussian around a prior pose holds what the tracks leave free, no more; or the one that
    is given.
    """
    if isinstance(prior, CameraPose):
        wide = np.diag(config.POSE_PRIOR_SD**2)
        prior = Normal(mean=plane_parameters_of(prior), covariance=wide)
    middle = prior.mean
    candidate = start.candidate.astype(np.float64)
    means: Sequence[Array] = start.means
    if len(means) != len(channels):
        means = [channel.learned.mean for channel in channels]
    precisions = [np.linalg.inv(channel.learned.covariance) for channel in channels]
    pose_precision = np.asarray(np.linalg.inv(prior.covariance), dtype=np.float64)
    # Near the end by the information of Student-t, which is less than its weights say.
    # Source: Lange, Little and Taylor 1989, scoring.
    share, last = FISHER, np.zeros(3, dtype=np.float64)
    settled = config.ROUGHLY if start.warm else config.CONVERGED
    for _ in range(config.MOST_ROUNDS):
        # Given the pose, the fields are independent: each is eliminated by itself.
        matrix = pose_precision.copy()
        gradient = pose_precision @ (candidate - middle)
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
        move = np.asarray(-np.linalg.solve(matrix, gradient), dtype=np.float64)
        far = float((np.abs(move) / config.LONGEST_MOVE).max())
        share = _share_by(last, move, matrix, share)
        if far >= _NEAR:
            share = min(share, 1.0, 1 / far)
        candidate, last = candidate + share * move, move
        means = [
            mean - share * (both[:, 3] + both[:, :3] @ move)
            for mean, both in zip(means, solved, strict=True)
        ]
        if share * share * float(move @ matrix @ move) < settled**2:
            break
    apart = candidate - middle
    log_likelihood = -0.5 * float(apart @ pose_precision @ apart)
    for channel, mean in zip(channels, means, strict=True):
        log_likelihood += float(_log_likelihoods(channel, candidate, mean).sum())
    return Fit(
        candidate=candidate,
        covariance=corrected_covariance(matrix, noise),
        bound=FISHER * np.asarray(np.linalg.inv(matrix)),
        log_likelihood=log_likelihood,
        means=tuple(means),
    )


def _share_by(last: Array, move: Array, matrix: Array, share: float) -> float:
    """How much of a move (3,) to go, by how much a share of the last one has left of it.

    A fixed share goes to and fro for ever where weights fall fast with the pose, and crawls where
    they grow: every eighth fit of recorded people did. Source: Barzilai and Borwein 1988.
    """
    if not last.any():
        return share
    gone = last - move
    along = float(last @ matrix @ gone)
    if along <= 0:
        return _SHARES[1]
    return float(np.clip(share * along / float(gone @ matrix @ gone), *_SHARES))


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


def noise_information(
    measured: Measured, weights: Weights, components: VarianceComponents
) -> Array:
    """The information (3, 3) on tilt, roll and log height that is noise's on average.

    Of a track's noise, its own level and trend take a part.
    """
    rows = measured.rows
    information = information_of_noise(
        measured.d_direction_noise, weights.row, measured.valid, rows.owner_idx, rows.owners
    )
    return information / components.within_sd**2


def corrected_covariance(matrix: Array, noise: Array) -> Array:
    """The covariance (3, 3) of a fit with information (3, 3) of which a part is noise.

    Errors scatter by all of the information and are brought back by the true part alone.
    """
    root = np.linalg.cholesky(matrix)
    white = np.linalg.solve(root, np.linalg.solve(root, noise).T)
    sizes, axes = np.linalg.eigh((white + white.T) / 2)
    stretched = np.linalg.solve(root.T, axes) / (1 - np.clip(sizes, 0.0, config.MOST_NOISE))
    return np.asarray(stretched @ stretched.T)


@compiled
def information_of_noise(
    noise: Array, weight: Array, valid: Mask, owner_idx: Index, owners: int
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


def starts(channels: Sequence[Channel], centre: Array, count: int) -> list[Array]:
    """The best few poses (3,) of a grid around a centre, at least 5 deg apart, and the centre."""
    offsets = np.linspace(-config.START_REACH_RAD, config.START_REACH_RAD, config.START_PLACES)
    grid = [centre + (tilt, roll, 0.0) for tilt in offsets for roll in offsets]
    return [*best_starts(channels, grid, count), centre]


def best_starts(
    channels: Sequence[Channel],
    grid: Iterable[Array],
    count: int,
    log_prior: Callable[[Array], float] = lambda _: 0.0,
) -> list[Array]:
    """The best few poses (3,) of a grid, at least 5 deg apart.

    For each tilt and roll of the grid the log height is that which brings a middle quantile of the
    speeds to the site's usual one. Places and directions are not looked at: this is only a start.
    """
    found = [
        (likely + log_prior(candidate), candidate)
        for each in grid
        for likely, candidate in _at(channels, each)
    ]
    found.sort(key=lambda pair: -pair[0])
    chosen: list[Array] = []
    for _, candidate in found:
        if len(chosen) == count:
            break
        apart = [np.abs((candidate - other)[:2]).max() for other in chosen]
        if all(far > config.START_DISTANCE_RAD for far in apart):
            chosen.append(candidate)
    return chosen


def _at(channels: Sequence[Channel], candidate: Array) -> list[tuple[float, Array]]:
    measures = [channel.measure(candidate=candidate, sloped=False) for channel in channels]
    speeds = measures[0]
    values = speeds.value[speeds.valid]
    if not values.size or values.size / speeds.valid.size < config.START_VALID:
        return []
    usual = channels[0].learned.usual
    found = []
    for quantile in _quantiles(values):
        taller = usual - quantile
        total = 0.0
        for channel, measured in zip(channels, measures, strict=True):
            moved = replace(measured, value=measured.value + taller)
            residual = moved.value - channel.learned.usual
            each = composite_log_likelihoods(residual, moved, channel.learned.components)
            total += float(each.sum())
        found.append((total, candidate + [0.0, 0.0, taller]))
    return found


def _quantiles(values: Array) -> list[float]:
    """The speeds' quantiles, as numpy's, which takes three times as long for so few."""
    places = np.array(config.START_QUANTILES) * (values.size - 1)
    found = np.interp(places, np.arange(values.size), np.sort(values))
    return [float(quantile) for quantile in found]
