"""Where speeds and places together lead from several starts, and how sure that makes of a pose."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.geometry.pose import CameraPose
from models.geometry.rotation import Array
from models.paths.likelihood import Walkers
from models.paths.path_test import loss
from models.paths.registration import Belief, Peak, Posterior, Site, distinct, register
from models.tracks.observations import Observations
from models.walking.estimate import JointEstimate, joint_near
from models.walking.fit import Near
from models.walking.speed_reference import SpeedReference

HEADING_SD = math.radians(15.0)  # a knock's, before any track is seen
REACH_RAD = math.radians(30.0)  # of the headings that are tried, both ways
_HEADINGS = np.radians(np.arange(-30.0, 31.0, 2.0))
_ROUNDS = 2  # in which the speeds are asked again
_ROUNDS_NEAR = 1  # where the heading is known by almost the same tracks
_FAR_LOG_HEIGHT = 0.7  # from the speeds': twice as high, everybody walks where nobody was seen
_NO_LOG_HEIGHT = 5.0  # from a pose's: 150 times as high or as low, nothing is seen
_UNLIKELY = 12.0  # of the log posterior, for the speeds to be asked no more
_SHARED = 3  # parameters that speeds and places both determine


@dataclass(frozen=True, slots=True, kw_only=True)
class End:
    """A peak, with the posterior that it is one of.

    `told` is what the speeds say with its heading, and `score` how much better they are explained
    so than with the prior pose's; that is part of the peak's value.
    """

    peak: Peak
    posterior: Posterior
    told: JointEstimate
    score: float

    @property
    def belief(self) -> Belief:
        """What was believed where it was climbed."""
        return self.posterior.belief

    @property
    def candidate(self) -> Array:
        """Tilt, roll, log height, heading (4,)."""
        return self.peak.candidate

    @property
    def believed(self) -> float:
        """The part of its value that is not by places."""
        return self.belief.log_density(self.candidate) + self.score


def ends_of(
    walkers: Walkers,
    site: Site,
    variance_inflation: float,
    joint: JointEstimate,
    observations: Observations,
    prior: CameraPose,
    speed_reference: SpeedReference,
    near: Sequence[Array] = (),
    told_near: Near | None = None,
) -> list[End]:
    """The ends of climbs from several headings, and poses by speeds; the likeliest first.

    Where it is known to be `near` some, as the ends of almost the same tracks, no others are tried.

    Args:
        walkers: who is asked where they walk.
        site: the map of that.
        variance_inflation: what the map's part is divided by.
        joint: what the speeds say, the heading taken for the prior pose's.
        observations: of all tracks, for the speeds to be asked again.
        prior: where the camera was.
        speed_reference: how people walk at the site.
        near: candidates (4,) to climb from; several headings are tried unless they are given.
        told_near: what the speeds say at the only one of them, of almost the same tracks.
    """
    first = Posterior(
        walkers=walkers,
        site=site,
        belief=_belief(joint, prior),
        variance_inflation=variance_inflation,
    )
    begin = [(Peak(candidate=candidate, value=-math.inf), _ROUNDS_NEAR) for candidate in near]
    if not near:
        begin = _from_afar(first, joint)
    ends = []
    for start, rounds in begin:
        peak, posterior, score, told = start, first, 0.0, joint
        for _ in range(rounds):
            at = peak.candidate
            told = joint_near(observations, prior, speed_reference, at, joint, told_near)
            posterior = replace(first, belief=_belief(told, prior))
            score = told.log_likelihood - joint.log_likelihood
            peak = posterior.climbed(peak.candidate)
        peak = replace(peak, value=peak.value + score)
        ends.append(End(peak=peak, posterior=posterior, told=told, score=score))
    ends = not_far_above(ends, float(joint.values[2]))
    kept = distinct([end.peak for end in ends])
    return [next(end for end in ends if end.peak is peak) for peak in kept]


def _from_afar(posterior: Posterior, joint: JointEstimate) -> list[tuple[Peak, int]]:
    """The peaks of several headings and the poses by speeds, and how often these are asked again.

    How fast people walk is asked of the likely ones only.
    """
    peaks = register(posterior, _HEADINGS)
    best = peaks[0].value
    begin = [(peak, _ROUNDS if peak.value > best - _UNLIKELY else 0) for peak in peaks]
    others = np.array([np.append(other, peaks[0].candidate[3]) for other in joint.others])
    if len(others):
        values = posterior.values(others).tolist()
        found = (Peak(candidate=c, value=v) for c, v in zip(others, values, strict=True))
        begin.extend((peak, _ROUNDS) for peak in found)
    return begin


def not_far_above(ends: list[End], log_height: float) -> list[End]:
    """Ends that are not twice or half as high as speeds say; all where there are no others."""
    return [end for end in ends if abs(end.candidate[2] - log_height) < _FAR_LOG_HEIGHT] or ends


def _belief(joint: JointEstimate, prior: CameraPose) -> Belief:
    """What the speeds say, and that knocks turn a camera by so much."""
    precision = np.zeros((4, 4))
    precision[:3, :3] = np.linalg.inv(joint.covariance)
    precision[3, 3] = HEADING_SD**-2.0
    return Belief(mean=np.append(joint.values, prior.heading_rad), precision=precision)


def apart(belief: Belief, known: Array, values: Array) -> float:
    """How much farther speeds and places are apart than their covariances say: 1 or more.

    Neither is trusted over the other: both are then less sure than they say.

    Source: Birge 1932, the ratio of external to internal consistency.
    """
    pull = belief.precision @ (values - belief.mean)
    squared = pull @ np.linalg.solve(belief.precision, pull) + pull @ np.linalg.solve(known, pull)
    return max(1.0, float(squared) / _SHARED)


def odds_of(walkers: Walkers, site: Site, ends: list[End]) -> Array:
    """How likely each end is against the first, by all it says or by known ground alone."""
    best = ends[0]
    odds = [1.0]
    for end in ends[1:]:
        worse = max(loss(walkers, site, best.candidate, end.candidate), 0.0)
        by_known = math.exp(-0.5 * worse**2 + min(end.believed - best.believed, 0.0))
        odds.append(max(math.exp(end.peak.value - best.peak.value), by_known))
    return np.array(odds)


def elsewhere(peaks: list[Peak], odds: Array) -> Array:
    """What other peaks add to the covariance (4, 4), each by its odds (P,); the first is best."""
    away = np.array([peak.candidate - peaks[0].candidate for peak in peaks])
    return np.asarray((away * (odds / odds.sum())[:, None]).T @ away)


def flatter(best: End, covariance: Array) -> Array:
    """What a posterior that is flatter than at its peak adds to the covariance (4, 4).

    Looked at along the heading, the other parameters following as they do around the peak. Nothing
    where that would take the camera to no height at all: so little is known then that nothing is
    told.
    """
    line = covariance[:, 3] / covariance[3, 3]
    sd = math.sqrt(covariance[3, 3])
    # Of a Gaussian, a sum over places one deviation apart is exact to 1e-8.
    turns = sd * np.arange(-4.0, 5.0)
    if abs(turns[-1] * line[2]) > _NO_LOG_HEIGHT:
        return np.zeros_like(covariance)
    values = best.posterior.values(best.candidate + turns[:, None] * line)
    density = np.exp(values - values.max())
    variance = float(density @ turns**2 / density.sum())
    return np.asarray(max(variance - sd**2, 0.0) * np.outer(line, line))
