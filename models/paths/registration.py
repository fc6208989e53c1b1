"""Registration: the pose, heading too, that puts walkers back on the site's paths.

Source: Berndt, Hall, Hall and Hausman 1974, steps by the scores' outer product; damped as by
Levenberg 1944. The curvature by differences of the scores is ours.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.geometry.pose import parameters_apart
from models.geometry.rotation import Array
from models.paths import config
from models.paths.likelihood import Likelihood, PathModel, Walkers

_SHORTEST_SHARE = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Belief:
    """A Gaussian on tilt, roll, log height and a Cauchy density on heading, which is far at times.

    Mean (4,) and precision (4, 4) are those at its peak; the heading's are apart from the others.
    """

    mean: Array
    precision: Array

    def log_density(self, candidate: Array) -> float:
        """The log density up to a constant."""
        apart = parameters_apart(candidate, self.mean)
        squared = float(apart[:3] @ self.precision[:3, :3] @ apart[:3])
        return -0.5 * squared - math.log1p(0.5 * float(self.precision[3, 3]) * apart[3] ** 2)

    def gaussian_at(self, candidate: Array) -> tuple[Array, Array]:
        """Slope (4,) at a candidate (4,), and the precision (4, 4) of a Gaussian with that slope.

        Source: Holland and Welsch 1977, iteratively reweighted least squares.
        """
        apart, precision = parameters_apart(candidate, self.mean), self.precision.copy()
        precision[3, 3] /= 1 + 0.5 * precision[3, 3] * apart[3] ** 2
        return -precision @ apart, precision


@dataclass(frozen=True, slots=True, kw_only=True)
class Peak:
    """The end of a climb: candidate (4,), and its log posterior."""

    candidate: Array
    value: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Shape:
    """The shape of the log likelihood around a candidate.

    `curvature` (4, 4) is how the log likelihood bends, `noise` (4, 4) how its slope scatters, by
    walking group. Were the map the truth and walking groups single walkers, they would be the same.
    """

    curvature: Array
    noise: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Posterior:
    """The log likelihood of walkers by a site's paths, tempered, and a belief beside.

    `variance_inflation` divides the likelihood: how much larger its squared errors are than its
    scores would have it.
    """

    walkers: Walkers
    paths: PathModel
    belief: Belief
    variance_inflation: float

    def values(self, candidates: Array) -> Array:
        """The log posteriors (K,) of candidates (K, 4), up to a constant."""
        likely = self.paths.track_log_likelihoods(self.walkers, candidates).sum(axis=1)
        believed = [self.belief.log_density(candidate) for candidate in candidates]
        return np.asarray(likely / self.variance_inflation + believed)

    def climbed(self, candidate: Array, least_gain: float = config.CONVERGED) -> Peak:
        """The peak above a candidate (4,), up to a gain that is not worth a step."""
        value, found = self._at(candidate)
        for _ in range(config.MOST_ROUNDS):
            believed, precision = self.belief.gaussian_at(candidate)
            slope = found.scores.sum(axis=0) / self.variance_inflation + believed
            matrix = _scatter(found.scores) / self.variance_inflation + precision
            move = np.linalg.solve(matrix + np.diag(1 + 1e-3 * np.diag(matrix)), slope)
            move = move * min(1.0, config.LONGEST_MOVE / max(float(np.abs(move).max()), 1e-12))
            share, gain = 1.0, -1.0
            while share > _SHORTEST_SHARE and gain <= 0:
                new_value, new_found = self._at(candidate + share * move)
                gain = new_value - value
                share /= 2
            if gain <= 0:
                break
            candidate, value, found = candidate + 2 * share * move, new_value, new_found
            if gain < least_gain:
                break
        return Peak(candidate=candidate, value=value)

    def _at(self, candidate: Array) -> tuple[float, Likelihood]:
        found = self.paths.likelihood(self.walkers, candidate)
        return found.value / self.variance_inflation + self.belief.log_density(candidate), found


def register(posterior: Posterior, headings: Sequence[float]) -> list[Peak]:
    """Peaks of a posterior, the highest first.

    The headings (radians) are tried around the belief's mean, the best of them that are 5 deg apart
    are climbed from, and ends that are the same are one.
    """
    tried = np.tile(posterior.belief.mean, (len(headings), 1))
    tried[:, 3] += headings
    log_posteriors = posterior.values(tried)
    begin: list[Array] = []
    for number in np.argsort(log_posteriors)[::-1]:
        turns = [abs(math.remainder(tried[number][3] - o[3], 2 * math.pi)) for o in begin]
        hopeless = log_posteriors[number] < log_posteriors.max() - config.HOPELESS
        apart = min(turns, default=np.inf) > config.STARTS_APART_RAD
        if len(begin) < config.STARTS and not hopeless and apart:
            begin.append(tried[number])
    return distinct([posterior.climbed(candidate) for candidate in begin])


def distinct(peaks: Sequence[Peak]) -> list[Peak]:
    """Peaks that are not about the same, the highest first."""
    kept: list[Peak] = []
    for peak in sorted(peaks, key=lambda peak: -peak.value):
        apart = [np.abs(parameters_apart(peak.candidate, o.candidate)).max() for o in kept]
        if min(apart, default=np.inf) > config.SAME_PEAK_RAD:
            kept.append(peak)
    return kept


def refined(
    posterior: Posterior,
    candidate: Array,
    shape: Shape,
    precision: Array,
    bias: Array,
    *,
    warm: bool = False,
) -> tuple[Array, Array]:
    """The candidate (4,) and its covariance (4, 4) if the map's part is weighed by direction.

    A single `variance_inflation` lets directions in which the map is noise drown a belief that is
    sure of them; so from the peak on, each of the map's slopes is taken for as much as it is worth.

    `shape` is of the map's log likelihood at the peak, `precision` (4, 4) its part, `bias` (4,) a
    person's mean score at the truth. A `warm` one, of almost the same tracks' pose, ends once
    hardly anything moves.
    """
    _, believed = posterior.belief.gaussian_at(candidate)
    information = precision + believed
    covariance = np.linalg.inv(information)
    gain = precision @ np.linalg.inv(shape.curvature)
    for _ in range(config.REFINING_ROUNDS):
        scores = posterior.paths.scores(posterior.walkers, candidate, candidate)
        slope = scores.sum(axis=0) - bias * scores.any(axis=1).sum()
        move = covariance @ (gain @ slope + posterior.belief.gaussian_at(candidate)[0])
        share = min(1.0, config.LONGEST_MOVE / max(np.abs(move).max(), 1e-12))
        candidate = candidate + move * share
        if warm and float(move @ information @ move) < config.ROUGHLY**2:
            break
    return candidate, np.asarray(covariance)


def shape_at(walkers: Walkers, paths: PathModel, candidate: Array) -> Shape:
    """The shape of the log likelihood around a candidate (4,)."""
    scores = paths.scores(walkers, candidate, candidate)
    curvature = _curvature(walkers, paths, candidate, scores)
    return Shape(curvature=curvature, noise=_noise(walkers, scores))


def _curvature(walkers: Walkers, paths: PathModel, candidate: Array, scores: Array) -> Array:
    """Minus the second derivative (4, 4) of the log likelihood, by differences of its slope.

    Where it bends less than the scores scatter, halfway between what is found in each direction
    and what is found on average: a map of some hundred people is rough, and so is how it bends.
    """
    steps = config.CURVATURE_STEP_RAD * np.eye(4)
    around = np.concatenate([candidate - steps, candidate + steps])
    back, on = np.split(paths.scores(walkers, around, candidate).sum(axis=1), 2)
    bent = (back - on) / (2 * config.CURVATURE_STEP_RAD)
    scatter = _scatter(scores)
    lower = np.linalg.cholesky(scatter + (1e-6 + 1e-6 * np.trace(scatter)) * np.eye(4))
    back = np.linalg.inv(lower)
    ratio, axes = np.linalg.eigh(back @ (bent + bent.T) / 2 @ back.T)
    ratio = np.maximum(ratio, 0.0)
    usual = min(max(float(ratio.mean()), config.LEAST_CURVATURE), 1.0)
    kept = (axes * np.maximum(ratio, (1 - config.EVEN) * ratio + config.EVEN * usual)) @ axes.T
    return np.asarray(lower @ kept @ lower.T)


def _noise(walkers: Walkers, scores: Array) -> Array:
    """The scatter (4, 4) of the sum of scores (N, 4): groups are independent, their people not."""
    walking_groups = np.zeros((walkers.tracks, 4))
    np.add.at(walking_groups, walkers.group_idx, scores)
    used = int(walking_groups.any(axis=1).sum())
    # Where scores add up to nothing, as at a peak, four of the walking groups are not free.
    return _scatter(walking_groups) * used / max(used - 4, 1)


def _scatter(scores: Array) -> Array:
    used = scores[scores.any(axis=1)]
    centred = used - used.mean(axis=0) if len(used) else used
    return np.asarray(centred.T @ centred)
