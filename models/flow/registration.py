"""Registration: the pose, heading too, that puts walkers back on the site's paths."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from models.flow.evidence import Likelihood, Walkers, likelihood
from models.flow.flow_map import Coverage, FlowMap
from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array

_STARTS = 3
_APART_RAD = np.radians(5)
_LONGEST_MOVE = 0.05
_MOST_ROUNDS = 25
_CONVERGED = 1e-3  # of the log likelihood
_SHORTEST_SHARE = 1e-3
_SAME_END = np.radians(0.3)


@dataclass(frozen=True, slots=True, kw_only=True)
class Belief:
    """A Gaussian on tilt, roll, log height, heading: mean (4,) and precision (4, 4)."""

    mean: Array
    precision: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Peak:
    """Where a search ended: candidate (4,), log posterior, and the information (4, 4) of the map.

    The information is the tracks' scores squared, so that steps of one track need not be
    independent.
    """

    candidate: Array
    value: float
    information: Array


def register(
    walkers: Walkers,
    flow: FlowMap,
    coverage: Coverage,
    intrinsics: Intrinsics,
    belief: Belief,
    *,
    temper: float,
    headings: Sequence[float],
) -> list[Peak]:
    """Peaks of the posterior, the highest first.

    The headings (radians) are tried around the belief's mean, the best of them that are 5 deg
    apart are climbed from, and ends that are the same are one. `temper` divides what the map
    says: how much larger its squared errors are than its scores would have it.
    """

    def posterior(candidate: Array) -> tuple[float, Likelihood]:
        found = likelihood(walkers, flow, coverage, intrinsics, candidate)
        apart = candidate - belief.mean
        return found.value / temper - 0.5 * float(apart @ belief.precision @ apart), found

    turns = np.array([0.0, 0.0, 0.0, 1.0])
    tried = [belief.mean + heading * turns for heading in headings]
    tried.sort(key=lambda candidate: -posterior(candidate)[0])
    begin: list[Array] = []
    for candidate in tried:
        if len(begin) < _STARTS and all(abs(candidate[3] - b[3]) > _APART_RAD for b in begin):
            begin.append(candidate)
    peaks: list[Peak] = []
    for candidate in begin:
        peak = _climbed(candidate, posterior, belief, temper)
        if all(np.abs(peak.candidate - p.candidate).max() > _SAME_END for p in peaks):
            peaks.append(peak)
    return sorted(peaks, key=lambda peak: -peak.value)


def _climbed(
    candidate: Array,
    posterior: Callable[[Array], tuple[float, Likelihood]],
    belief: Belief,
    temper: float,
) -> Peak:
    value, found = posterior(candidate)
    for _ in range(_MOST_ROUNDS):
        information = _information(found)
        slope = found.scores.sum(axis=0) / temper - belief.precision @ (candidate - belief.mean)
        matrix = information / temper + belief.precision
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
    return Peak(candidate=candidate, value=value, information=_information(found))


def _information(found: Likelihood) -> Array:
    used = found.scores[found.scores.any(axis=1)]
    centred = used - used.mean(axis=0) if len(used) else used
    return np.asarray(centred.T @ centred)
