"""Registration: the pose, heading too, that puts walkers back on the site's paths."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from models.flow.evidence import Likelihood, Walkers, likelihood
from models.flow.flow_map import FlowMap
from models.flow.view import Coverage
from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array

_STARTS = 3
_APART_RAD = np.radians(5)
_LONGEST_MOVE = 0.05
_MOST_ROUNDS = 25
_SETTLING_ROUNDS = 4
_CONVERGED = 1e-3  # of the log likelihood
_SHORTEST_SHARE = 1e-3
_SAME_END = np.radians(0.3)
_DIFFERENCE = np.radians(0.6)
_LEAST_CURVATURE = 0.02  # of what the scores say
_EVEN = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Site:
    """What walkers are registered to: a flow map, its coverage, and the camera's intrinsics."""

    flow: FlowMap
    coverage: Coverage
    intrinsics: Intrinsics

    def likelihood(self, walkers: Walkers, candidate: Array) -> Likelihood:
        """How likely the walkers are, seen from a candidate (4,)."""
        return likelihood(walkers, self.flow, self.coverage, self.intrinsics, candidate)


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
    """Where a search ended: candidate (4,), log posterior, and what the map says there.

    `curvature` (4, 4) is how the log likelihood bends, `noise` (4, 4) how its slope scatters, by
    party. Were the map the truth and parties single walkers, they would be the same.
    """

    candidate: Array
    value: float
    curvature: Array
    noise: Array


def register(
    walkers: Walkers, site: Site, belief: Belief, *, temper: float, headings: Sequence[float]
) -> list[Peak]:
    """Peaks of the posterior, the highest first.

    The headings (radians) are tried around the belief's mean, the best of them that are 5 deg
    apart are climbed from, and ends that are the same are one. `temper` divides what the map
    says: how much larger its squared errors are than its scores would have it.
    """

    def posterior(candidate: Array) -> tuple[float, Likelihood]:
        found = site.likelihood(walkers, candidate)
        return found.value / temper + belief.log_density(candidate), found

    turns = np.array([0.0, 0.0, 0.0, 1.0])
    tried = [belief.mean + heading * turns for heading in headings]
    tried.sort(key=lambda candidate: -posterior(candidate)[0])
    begin: list[Array] = []
    for candidate in tried:
        if len(begin) < _STARTS and all(abs(candidate[3] - b[3]) > _APART_RAD for b in begin):
            begin.append(candidate)
    ends: list[tuple[Array, float, Likelihood]] = []
    for candidate in begin:
        end = _climbed(candidate, posterior, belief, temper)
        if all(np.abs(end[0] - other[0]).max() > _SAME_END for other in ends):
            ends.append(end)
    ends.sort(key=lambda end: -end[1])
    return [
        Peak(
            candidate=candidate,
            value=value,
            curvature=_curvature(walkers, site, candidate, found),
            noise=_noise(walkers, found),
        )
        for candidate, value, found in ends
    ]


def settled(
    walkers: Walkers, site: Site, belief: Belief, peak: Peak, precision: Array
) -> tuple[Array, Array]:
    """The candidate (4,) and its covariance (4, 4) if the map's part is weighed by direction.

    `precision` (4, 4) is what the map's part knows. A single `temper` lets directions in which the
    map is noise drown a belief that is sure of them; so from the peak on, each of the map's slopes
    is taken for as much as it is worth.
    """
    covariance = np.linalg.inv(precision + belief.precision)
    gain = precision @ np.linalg.inv(peak.curvature)
    candidate = peak.candidate
    for _ in range(_SETTLING_ROUNDS):
        slope = site.likelihood(walkers, candidate).scores.sum(axis=0)
        move = covariance @ (gain @ slope - belief.precision @ (candidate - belief.mean))
        candidate = candidate + move * min(1.0, _LONGEST_MOVE / max(np.abs(move).max(), 1e-12))
    return candidate, covariance


def _climbed(
    candidate: Array,
    posterior: Callable[[Array], tuple[float, Likelihood]],
    belief: Belief,
    temper: float,
) -> tuple[Array, float, Likelihood]:
    value, found = posterior(candidate)
    for _ in range(_MOST_ROUNDS):
        slope = found.scores.sum(axis=0) / temper - belief.precision @ (candidate - belief.mean)
        matrix = _scatter(found.scores) / temper + belief.precision
        move = np.linalg.solve(matrix + np.diag(1 + 1e-3 * np.diag(matrix)), slope)
        move = move * min(1.0, _LONGEST_MOVE / max(float(np.abs(move).max()), 1e-12))
        share, gain = 1.0, -1.0
        while share > _SHORTEST_SHARE and gain <= 0:
            new_value, new_found = posterior(candidate + share * move)
            gain = new_value - value
            share /= 2
        if gain <= 0:
            break
        candidate, value, found = candidate + 2 * share * move, new_value, new_found
        if gain < _CONVERGED:
            break
    return candidate, value, found


def _curvature(walkers: Walkers, site: Site, candidate: Array, found: Likelihood) -> Array:
    """Minus the second derivative (4, 4) of the log likelihood, by differences of its slope.

    Against the scatter of the scores, halfway between what is found in each direction and what is
    found on average: a map of some hundred people is rough, and so is how it bends.
    """
    slopes = [
        site.likelihood(walkers, candidate - step).scores.sum(axis=0)
        - site.likelihood(walkers, candidate + step).scores.sum(axis=0)
        for step in _DIFFERENCE * np.eye(4)
    ]
    bent = np.array(slopes) / (2 * _DIFFERENCE)
    scatter = _scatter(found.scores) + 1e-6 * np.eye(4)
    lower = np.linalg.cholesky(scatter)
    back = np.linalg.inv(lower)
    ratio, axes = np.linalg.eigh(back @ (bent + bent.T) / 2 @ back.T)
    ratio = np.maximum(ratio, 0.0)
    usual = max(float(ratio.mean()), _LEAST_CURVATURE)
    kept = (axes * ((1 - _EVEN) * ratio + _EVEN * usual)) @ axes.T
    return np.asarray(lower @ kept @ lower.T)


def _noise(walkers: Walkers, found: Likelihood) -> Array:
    """How the sum of all scores scatters (4, 4): parties are independent, their people are not."""
    parties = np.zeros((walkers.tracks, 4))
    np.add.at(parties, walkers.party_idx, found.scores)
    used = int(parties.any(axis=1).sum())
    # Where scores add up to nothing, as at a peak, four of the parties are not free.
    return _scatter(parties) * used / max(used - 4, 1)


def _scatter(scores: Array) -> Array:
    used = scores[scores.any(axis=1)]
    centred = used - used.mean(axis=0) if len(used) else used
    return np.asarray(centred.T @ centred)
