"""Registration: the pose, heading too, that puts walkers back on the site's paths.

Source: Berndt, Hall, Hall and Hausman 1974, steps by the scores' outer product; damped as by
Levenberg 1944. The curvature by differences of the scores is ours.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array
from models.paths.likelihood import (
    Likelihood,
    Walkers,
    anchored_scores,
    likelihood,
    track_values,
)
from models.paths.map.density_map import FlowMap
from models.paths.map.view import Coverage

_STARTS = 3
_APART_RAD = np.radians(5)
_HOPELESS = 40.0  # of the log posterior: a start so far below another ends below it, too
_LONGEST_MOVE = 0.05
_MOST_ROUNDS = 25
_SETTLING_ROUNDS = 4
_ROUGHLY = 0.03  # standard deviations
CONVERGED = 1e-3  # of the log likelihood
_SHORTEST_SHARE = 1e-3
_SAME_END = np.radians(0.3)
_DIFFERENCE = np.radians(0.6)
_LEAST_CURVATURE = 0.02  # of what the scores say
_EVEN = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Site:
    """What walkers are registered to: a flow map, its coverage and the camera's intrinsics."""

    flow: FlowMap
    coverage: Coverage
    intrinsics: Intrinsics

    def likelihood(self, walkers: Walkers, candidate: Array) -> Likelihood:
        """How likely the walkers are, seen from a candidate (4,)."""
        return likelihood(walkers, self.flow, self.coverage, self.intrinsics, candidate)

    def track_log_likelihoods(self, walkers: Walkers, candidates: Array) -> Array:
        """The log likelihood (K, N) of each track alone, seen from candidates (K, 4)."""
        return track_values(walkers, self.flow, self.coverage, self.intrinsics, candidates)

    def scores(self, walkers: Walkers, candidates: Array, anchor: Array) -> Array:
        """Scores (..., N, 4) at candidates (..., 4) of who is on ground that an anchor knows."""
        return anchored_scores(
            walkers, self.flow, self.coverage, self.intrinsics, candidates, anchor
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Belief:
    """A Gaussian on tilt, roll, log height, heading: mean (4,) and precision (4, 4)."""

    mean: Array
    precision: Array

    def log_density(self, candidate: Array) -> float:
        """Up to a constant."""
        apart = candidate - self.mean
        return -0.5 * float(apart @ self.precision @ apart)


@dataclass(frozen=True, slots=True, kw_only=True)
class Peak:
    """Where a climb ended: candidate (4,), and its log posterior."""

    candidate: Array
    value: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Shape:
    """What the map says around a candidate.

    `curvature` (4, 4) is how the log likelihood bends, `noise` (4, 4) how its slope scatters, by
    walking group. Were the map the truth and walking groups single walkers, they would be the same.
    """

    curvature: Array
    noise: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Posterior:
    """What walkers say by a map, tempered, and what is believed beside.

    `variance_inflation` divides what the map says: how much larger its squared errors are than its
    scores would have it.
    """

    walkers: Walkers
    site: Site
    belief: Belief
    variance_inflation: float

    def values(self, candidates: Array) -> Array:
        """The log posteriors (K,) of candidates (K, 4), up to a constant."""
        chances = self.site.track_log_likelihoods(self.walkers, candidates).sum(axis=1)
        believed = [self.belief.log_density(candidate) for candidate in candidates]
        return np.asarray(chances / self.variance_inflation + believed)

    def climbed(self, candidate: Array, least_gain: float = CONVERGED) -> Peak:
        """The peak above a candidate (4,), up to a gain that is not worth a step."""
        value, found = self._asked(candidate)
        for _ in range(_MOST_ROUNDS):
            believed = self.belief.precision @ (candidate - self.belief.mean)
            slope = found.scores.sum(axis=0) / self.variance_inflation - believed
            matrix = _scatter(found.scores) / self.variance_inflation + self.belief.precision
            move = np.linalg.solve(matrix + np.diag(1 + 1e-3 * np.diag(matrix)), slope)
            move = move * min(1.0, _LONGEST_MOVE / max(float(np.abs(move).max()), 1e-12))
            share, gain = 1.0, -1.0
            while share > _SHORTEST_SHARE and gain <= 0:
                new_value, new_found = self._asked(candidate + share * move)
                gain = new_value - value
                share /= 2
            if gain <= 0:
                break
            candidate, value, found = candidate + 2 * share * move, new_value, new_found
            if gain < least_gain:
                break
        return Peak(candidate=candidate, value=value)

    def _asked(self, candidate: Array) -> tuple[float, Likelihood]:
        found = self.site.likelihood(self.walkers, candidate)
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
        apart = [abs(tried[number][3] - other[3]) for other in begin]
        hopeless = log_posteriors[number] < log_posteriors.max() - _HOPELESS
        if len(begin) < _STARTS and not hopeless and min(apart, default=np.inf) > _APART_RAD:
            begin.append(tried[number])
    return distinct([posterior.climbed(candidate) for candidate in begin])


def distinct(peaks: Sequence[Peak]) -> list[Peak]:
    """Peaks that are not about the same, the highest first."""
    kept: list[Peak] = []
    for peak in sorted(peaks, key=lambda peak: -peak.value):
        if all(np.abs(peak.candidate - other.candidate).max() > _SAME_END for other in kept):
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

    Args:
        posterior: of walkers.
        candidate: its peak (4,).
        shape: of the map's log likelihood there.
        precision: of the map's part (4, 4).
        bias: a person's mean score at the truth (4,).
        warm: from almost the same tracks' pose, where it ends once hardly anything moves.
    """
    belief = posterior.belief
    known = precision + belief.precision
    covariance = np.linalg.inv(known)
    gain = precision @ np.linalg.inv(shape.curvature)
    for _ in range(_SETTLING_ROUNDS):
        scores = posterior.site.scores(posterior.walkers, candidate, candidate)
        slope = scores.sum(axis=0) - bias * scores.any(axis=1).sum()
        move = covariance @ (gain @ slope - belief.precision @ (candidate - belief.mean))
        candidate = candidate + move * min(1.0, _LONGEST_MOVE / max(np.abs(move).max(), 1e-12))
        if warm and float(move @ known @ move) < _ROUGHLY**2:
            break
    return candidate, np.asarray(covariance)


def shape_at(walkers: Walkers, site: Site, candidate: Array) -> Shape:
    """What a map says around a candidate (4,)."""
    scores = site.scores(walkers, candidate, candidate)
    return Shape(
        curvature=_curvature(walkers, site, candidate, scores), noise=noise_of(walkers, scores)
    )


def curvature_of(walkers: Walkers, site: Site, candidate: Array) -> Array:
    """How the log likelihood bends (4, 4) around a candidate (4,)."""
    return _curvature(walkers, site, candidate, site.scores(walkers, candidate, candidate))


def _curvature(walkers: Walkers, site: Site, candidate: Array, scores: Array) -> Array:
    """Minus the second derivative (4, 4) of the log likelihood, by differences of its slope.

    Where it bends less than the scores scatter, halfway between what is found in each direction
    and what is found on average: a map of some hundred people is rough, and so is how it bends.
    """
    steps = _DIFFERENCE * np.eye(4)
    around = np.concatenate([candidate - steps, candidate + steps])
    back, on = np.split(site.scores(walkers, around, candidate).sum(axis=1), 2)
    bent = (back - on) / (2 * _DIFFERENCE)
    scatter = _scatter(scores)
    lower = np.linalg.cholesky(scatter + (1e-6 + 1e-6 * np.trace(scatter)) * np.eye(4))
    back = np.linalg.inv(lower)
    ratio, axes = np.linalg.eigh(back @ (bent + bent.T) / 2 @ back.T)
    ratio = np.maximum(ratio, 0.0)
    usual = min(max(float(ratio.mean()), _LEAST_CURVATURE), 1.0)
    kept = (axes * np.maximum(ratio, (1 - _EVEN) * ratio + _EVEN * usual)) @ axes.T
    return np.asarray(lower @ kept @ lower.T)


def noise_of(walkers: Walkers, scores: Array) -> Array:
    """How the sum of scores (N, 4) scatters (4, 4): groups are independent, their people not."""
    walking_groups = np.zeros((walkers.tracks, 4))
    np.add.at(walking_groups, walkers.group_idx, scores)
    used = int(walking_groups.any(axis=1).sum())
    # Where scores add up to nothing, as at a peak, four of the walking groups are not free.
    return _scatter(walking_groups) * used / max(used - 4, 1)


def _scatter(scores: Array) -> Array:
    used = scores[scores.any(axis=1)]
    centred = used - used.mean(axis=0) if len(used) else used
    return np.asarray(centred.T @ centred)
