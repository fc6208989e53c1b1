"""The modes of speeds and places together, from several headings, and their covariances."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.geometry.pose import CameraPose, parameters_apart
from models.geometry.rotation import Array
from models.paths.path_tests import loss
from models.paths.registration import Belief, Peak, Posterior, distinct, register
from models.pose import config
from models.pose.pose_fit import WarmStart
from models.pose.site import CameraSite
from models.tracks.observations import Observations
from models.walking.estimate import JointEstimate, joint_at_heading


@dataclass(frozen=True, slots=True, kw_only=True)
class Mode:
    """A peak, with the posterior that it is one of.

    `speeds` is the joint estimate with its heading, and `gain` how much better that explains them
    than with the prior pose's heading, in logs; that is part of the peak's value.
    """

    peak: Peak
    posterior: Posterior
    speeds: JointEstimate
    gain: float

    @property
    def candidate(self) -> Array:
        """Tilt, roll, log height, heading (4,)."""
        return self.peak.candidate

    @property
    def log_belief(self) -> float:
        """The part of its value that is not by places."""
        return self.posterior.belief.log_density(self.candidate) + self.gain


def belief_of(joint: JointEstimate, prior: CameraPose) -> Belief:
    """The belief by speeds, with that in a pose offset's heading."""
    precision = np.zeros((4, 4))
    precision[:3, :3] = np.linalg.inv(joint.covariance)
    precision[3, 3] = config.HEADING_SD**-2.0
    return Belief(mean=np.append(joint.values, prior.heading_rad), precision=precision)


def find_modes(
    posterior: Posterior,
    tracks: Observations,
    site: CameraSite,
    joint: JointEstimate,
    warm_start: WarmStart | None = None,
    headings: Sequence[float] = config.HEADINGS,
) -> list[Mode]:
    """The modes that are climbed to from several headings and from poses by speeds, the best first.

    `headings` are from the prior pose's on (radians). With a `warm_start` its modes alone are
    climbed from.
    """
    if warm_start is None:
        begin = _from_afar(posterior, joint, headings)
    else:
        modes = warm_start.fused.modes
        begin = [(Peak(candidate=mode, value=-math.inf), config.WARM_ROUNDS) for mode in modes]
    found = []
    for peak, rounds in begin:
        mode = Mode(peak=peak, posterior=posterior, speeds=joint, gain=0.0)
        for _ in range(rounds):
            mode = _climbed(mode, tracks, site, joint, warm_start)
        found.append(replace(mode, peak=replace(mode.peak, value=mode.peak.value + mode.gain)))
    found = not_far_above(found, float(joint.values[2]))
    kept = distinct([mode.peak for mode in found])
    return [next(mode for mode in found if mode.peak is peak) for peak in kept]


def _from_afar(
    posterior: Posterior, joint: JointEstimate, headings: Sequence[float]
) -> list[tuple[Peak, int]]:
    """The peaks of several headings and the poses by speeds, with their rounds of speeds.

    Speeds are fitted again at the likely ones only.
    """
    peaks = register(posterior, headings)
    best = peaks[0].value
    begin = [(peak, config.ROUNDS if peak.value > best - config.UNLIKELY else 0) for peak in peaks]
    others = np.array([np.append(other, peaks[0].candidate[3]) for other in joint.others])
    if len(others):
        values = posterior.values(others).tolist()
        found = (Peak(candidate=c, value=v) for c, v in zip(others, values, strict=True))
        begin.extend((peak, config.ROUNDS) for peak in found)
    return begin


def _climbed(
    mode: Mode,
    tracks: Observations,
    site: CameraSite,
    joint: JointEstimate,
    warm_start: WarmStart | None,
) -> Mode:
    """The mode with the speeds fitted at its heading, and the peak above it."""
    speeds = joint_at_heading(
        tracks,
        site.prior,
        site.speed_reference,
        mode.candidate,
        joint,
        None if warm_start is None else warm_start.speeds,
    )
    posterior = replace(mode.posterior, belief=belief_of(speeds, site.prior))
    return Mode(
        peak=posterior.climbed(mode.candidate),
        posterior=posterior,
        speeds=speeds,
        gain=speeds.log_likelihood - joint.log_likelihood,
    )


def not_far_above(modes: list[Mode], log_height: float) -> list[Mode]:
    """Modes that are not twice or half as high as speeds say; all where there are no others."""
    far = config.FAR_LOG_HEIGHT
    return [mode for mode in modes if abs(mode.candidate[2] - log_height) < far] or modes


def odds_of(modes: list[Mode]) -> Array:
    """The odds of each mode against the first, by all it says or by seen ground alone."""
    best, odds = modes[0], [1.0]
    walkers, paths = best.posterior.walkers, best.posterior.paths
    for mode in modes[1:]:
        worse = max(loss(walkers, paths, best.candidate, mode.candidate), 0.0)
        by_seen = math.exp(-0.5 * worse**2 + min(mode.log_belief - best.log_belief, 0.0))
        odds.append(max(math.exp(mode.peak.value - best.peak.value), by_seen))
    return np.array(odds)


def birge_ratio(belief: Belief, precision: Array, values: Array) -> float:
    """The ratio of how far apart speeds and places are to what their covariances say: 1 or more.

    Neither is trusted over the other: both are then less sure than they say.

    Source: Birge 1932, the ratio of external to internal consistency.
    """
    pull, believed = belief.gaussian_at(values)
    squared = pull @ np.linalg.solve(believed, pull) + pull @ np.linalg.solve(precision, pull)
    return max(1.0, float(squared) / config.SHARED)


def covariance_between(peaks: list[Peak], odds: Array) -> Array:
    """The covariance (4, 4) around the first of some modes by the others, with odds (P,)."""
    away = np.array([parameters_apart(peak.candidate, peaks[0].candidate) for peak in peaks])
    return np.asarray((away * (odds / odds.sum())[:, None]).T @ away)
