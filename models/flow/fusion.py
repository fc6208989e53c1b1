"""The fused pose: the joint estimate's speeds and the flow map's places, in one posterior.

Ours: log p(pose) = log N(pose; joint estimate) + log likelihood of the map / variance inflation.
"""

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from models.estimation.joint.estimate import JointEstimate
from models.estimation.joint.observations import Observations
from models.estimation.parameters import IDENTIFIABLE_SD, identifiable_of
from models.flow.likelihood import Walkers, walkers_of
from models.flow.path_test import group_fits, loss
from models.flow.reference import FlowReference, candidate_of
from models.flow.registration import Belief, Peak, Site, register, settled
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.pose_parameters import PARAMETERS, PoseParameters
from models.geometry.rotation import Array
from models.reasons import Reason, TracksCode

_HEADINGS = np.radians(np.arange(-30.0, 31.0, 2.0))
_HEADING_SD = math.radians(15.0)  # a knock's, before any track is seen
_FEWEST_GROUPS = 5
_CONFLICT = 3.0  # squared standard deviations of the joint estimate, in three parameters
_TRUST = 25.0
_RIVAL = 0.05  # how likely, against the best, another pose must be to be named


@dataclass(frozen=True, slots=True, kw_only=True)
class FusedEstimate:
    """Tilt, roll, log height, heading (4,) with their covariance (4, 4).

    `identifiable` names those of tilt, roll, height, heading that the tracks determine; `reason`
    is what is to be said of the flow map, if anything. `raw` (4,) is before the map's bias is taken
    off; None where the map had no part: then all is the joint estimate's and the heading the prior
    pose's.
    `rivals` are headings (radians) of other poses that explain the tracks about as well.
    """

    values: Array
    covariance: Array
    identifiable: tuple[str, ...]
    reason: Reason | None
    raw: Array | None = None
    rivals: tuple[float, ...] = ()

    @property
    def registered(self) -> bool:
        """Whether the flow map had a part."""
        return self.raw is not None

    @property
    def parameters(self) -> PoseParameters:
        """What is estimated, named."""
        return PoseParameters.of_array(self.values)

    @property
    def sd(self) -> PoseParameters:
        """The standard deviations, named."""
        return PoseParameters.sd_of_array(self.covariance, self.parameters.height_m)

    @property
    def raw_parameters(self) -> PoseParameters | None:
        """What `raw` is, named."""
        return None if self.raw is None else PoseParameters.of_array(self.raw)


def fused_estimate(
    observations: Observations,
    intrinsics: Intrinsics,
    prior: CameraPose,
    joint: JointEstimate,
    reference: FlowReference,
) -> FusedEstimate:
    """The pose by speeds and places together.

    A track's speeds, given where and which way it goes, and where it goes are two factors of one
    likelihood. So what the joint estimate says is a belief that the map's likelihood multiplies.
    """
    mean = np.append(joint.values, prior.heading_rad)
    precision = np.zeros((4, 4))
    precision[:3, :3] = np.linalg.inv(joint.covariance)
    precision[3, 3] = _HEADING_SD**-2.0
    walkers = walkers_of(observations, mean)
    if walkers.walking_groups < _FEWEST_GROUPS:
        return by_speeds_alone(joint, prior)
    site = reference.site(intrinsics)
    variance_inflation = reference.variance_inflation_for(walkers.people)
    search = partial(
        register, walkers, site, variance_inflation=variance_inflation, headings=_HEADINGS
    )
    belief = Belief(mean=mean, precision=precision)
    peaks = search(belief)
    apart = (peaks[0].candidate - mean)[:3]
    if float(apart @ precision[:3, :3] @ apart) > _CONFLICT:
        # Speeds and places contradict one another; speeds are the better proven of the two.
        firm = precision.copy()
        firm[:3, :3] *= _TRUST
        belief = Belief(mean=mean, precision=firm)
        peaks = search(belief)
    best = peaks[0]
    move = best.candidate - candidate_of(prior)
    known = reference.precision(best, walkers.people, move)
    values, covariance = settled(walkers, site, belief, best, known, reference.bias)
    if belief.precision is not precision:
        covariance = np.asarray(np.linalg.inv(known + precision))
    odds = _odds(walkers, site, belief, peaks)
    covariance = covariance + elsewhere(peaks, odds)
    covariance = covariance + _spread(walkers, site, belief, best, covariance, variance_inflation)
    if reference.fit.has_changed(group_fits(walkers, site, values)):
        return by_speeds_alone(joint, prior, Reason(code=TracksCode.PATHS_CHANGED))
    rivals = tuple(
        float(peak.candidate[3])
        for peak, against_best in zip(peaks, odds, strict=True)
        if peak is not best and against_best > _RIVAL
    )
    sd = np.sqrt(np.diag(covariance))
    return FusedEstimate(
        values=values,
        covariance=covariance,
        identifiable=identifiable_of(PARAMETERS, sd),
        reason=_reason(float(values[3]), rivals, float(sd[3]), prior),
        raw=best.candidate,
        rivals=rivals,
    )


def by_speeds_alone(
    joint: JointEstimate, prior: CameraPose, reason: Reason | None = None
) -> FusedEstimate:
    """The joint estimate with the prior's heading, which speeds leave open."""
    covariance = np.zeros((4, 4))
    covariance[:3, :3] = joint.covariance
    covariance[3, 3] = _HEADING_SD**2
    return FusedEstimate(
        values=np.append(joint.values, prior.heading_rad),
        covariance=covariance,
        identifiable=joint.identifiable,
        reason=reason,
    )


def _reason(
    heading: float, rivals: tuple[float, ...], sd: float, prior: CameraPose
) -> Reason | None:
    if rivals:
        turns = sorted(turn - prior.heading_rad for turn in (heading, *rivals))
        return Reason(code=TracksCode.HEADING_AMBIGUOUS, values={"turns_rad": turns})
    if sd > IDENTIFIABLE_SD[3]:
        return Reason(code=TracksCode.HEADING_UNIDENTIFIABLE, values={"heading_sd_rad": sd})
    return None


def _odds(walkers: Walkers, site: Site, belief: Belief, peaks: list[Peak]) -> Array:
    """How likely each peak is against the first, by all it says or by known ground alone."""
    best = peaks[0]
    odds = [1.0]
    for peak in peaks[1:]:
        worse = max(loss(walkers, site, best.candidate, peak.candidate), 0.0)
        believed = belief.log_density(peak.candidate) - belief.log_density(best.candidate)
        by_known = math.exp(-0.5 * worse**2 + min(believed, 0.0))
        odds.append(max(math.exp(peak.value - best.value), by_known))
    return np.array(odds)


def elsewhere(peaks: list[Peak], odds: Array) -> Array:
    """What other peaks add to the covariance (4, 4), each by its odds (P,); the first is best."""
    apart = np.array([peak.candidate - peaks[0].candidate for peak in peaks])
    return np.asarray((apart * (odds / odds.sum())[:, None]).T @ apart)


def _spread(
    walkers: Walkers,
    site: Site,
    belief: Belief,
    best: Peak,
    covariance: Array,
    variance_inflation: float,
) -> Array:
    """What a posterior that is flatter than at its peak adds to the covariance (4, 4).

    Looked at along the heading, the other parameters following as they do around the peak.
    """
    line = covariance[:, 3] / covariance[3, 3]
    sd = math.sqrt(covariance[3, 3])
    turns = sd * np.linspace(-4, 4, 17)
    values = []
    for turn in turns:
        candidate = best.candidate + turn * line
        log_likelihood = site.track_log_likelihoods(walkers, candidate).sum()
        values.append(log_likelihood / variance_inflation + belief.log_density(candidate))
    density = np.exp(np.array(values) - max(values))
    variance = float(density @ turns**2 / density.sum())
    return np.asarray(max(variance - sd**2, 0.0) * np.outer(line, line))
