"""The fused pose: the joint estimate's speeds and the flow map's places, in one posterior."""

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from models.estimation.joint.estimate import JointEstimate
from models.estimation.joint.observations import Observations
from models.estimation.numbers import NUMBERS
from models.flow.evidence import Walkers, walkers_of
from models.flow.reference import FlowReference, precision_of
from models.flow.registration import Belief, Peak, Site, register, settled
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array

_HEADINGS = np.radians(np.arange(-30.0, 31.0, 2.0))
_HEADING_SD = math.radians(15.0)  # a knock's, before any track is seen
_FEWEST_PARTIES = 5
_CONFLICT = 3.0  # squared standard deviations of the joint estimate, in three numbers
_TRUST = 25.0
_TELLING_SD = np.array([math.radians(2.0), math.radians(2.0), 0.12, math.radians(2.0)])
_FUSED = (*NUMBERS, "heading")
_RIVAL = 3.0  # by how much less likely, in the log, another pose may be that is still named


@dataclass(frozen=True, slots=True, kw_only=True)
class FusedEstimate:
    """Tilt, roll, log height, heading (4,) with their covariance (4, 4).

    `told` names those of tilt, roll, height, heading that the tracks can tell; `reason` says in
    words what they cannot and why, empty where they tell all. `registered` is whether the flow map
    had a part; without, all is the joint estimate's and the heading the prior pose's. `rivals` are
    headings (radians) of other poses that explain the tracks about as well.
    """

    values: Array
    covariance: Array
    told: tuple[str, ...]
    reason: str
    registered: bool
    rivals: tuple[float, ...] = ()


def fused_estimate(
    observations: Observations,
    intrinsics: Intrinsics,
    prior: CameraPose,
    joint: JointEstimate,
    reference: FlowReference,
) -> FusedEstimate:
    """The pose by speeds and places together.

    A track's speeds, given where and which way it goes, and where it goes are two factors of one
    likelihood. So what the joint estimate says is a belief that the map's likelihood multiplies,
    and both offsets are taken off.
    """
    # The map is looked at where registration would end were the joint estimate right.
    mean = np.append(joint.values, prior.heading_rad) + reference.offset
    precision = np.zeros((4, 4))
    precision[:3, :3] = np.linalg.inv(joint.covariance)
    precision[3, 3] = _HEADING_SD**-2.0
    walkers = walkers_of(observations, mean)
    if walkers.parties < _FEWEST_PARTIES:
        return _unregistered(joint, prior, joint.reason)
    site = reference.site(intrinsics)
    temper = reference.temper_for(walkers.people)
    search = partial(register, walkers, site, temper=temper, headings=_HEADINGS)
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
    noise = reference.surprise * reference.map_noise(walkers.people)
    known = precision_of(best, noise)
    values, covariance = settled(walkers, site, belief, best, known)
    if belief.precision is not precision:
        covariance = np.linalg.inv(known + precision)
    share = covariance @ known
    covariance = covariance + _elsewhere(peaks)
    covariance = covariance + _spread(walkers, site, belief, best, covariance, temper)
    # Of the offset only as much is unsure as the map decides.
    covariance = covariance + share @ reference.offset_covariance @ share.T
    sd = np.sqrt(np.diag(covariance))
    return FusedEstimate(
        values=values - reference.offset,
        covariance=covariance,
        told=tuple(n for n, telling in zip(_FUSED, sd <= _TELLING_SD, strict=True) if telling),
        reason="",
        registered=True,
        rivals=tuple(
            float(peak.candidate[3] - reference.offset[3])
            for peak in peaks[1:]
            if peak.value > best.value - _RIVAL
        ),
    )


def _unregistered(joint: JointEstimate, prior: CameraPose, reason: str) -> FusedEstimate:
    """The joint estimate alone."""
    covariance = np.zeros((4, 4))
    covariance[:3, :3] = joint.covariance
    covariance[3, 3] = _HEADING_SD**2
    return FusedEstimate(
        values=np.append(joint.values, prior.heading_rad),
        covariance=covariance,
        told=tuple(name for name in NUMBERS if name not in joint.weak),
        reason=reason,
        registered=False,
    )


def _elsewhere(peaks: list[Peak]) -> Array:
    """What other peaks add to the covariance (4, 4)."""
    chances = np.exp([peak.value - peaks[0].value for peak in peaks])
    apart = np.array([peak.candidate - peaks[0].candidate for peak in peaks])
    return np.asarray((apart * (chances / chances.sum())[:, None]).T @ apart)


def _spread(
    walkers: Walkers, site: Site, belief: Belief, best: Peak, covariance: Array, temper: float
) -> Array:
    """What a posterior that is flatter than at its peak adds to the covariance (4, 4).

    Looked at along the heading, the other numbers following as they do around the peak.
    """
    line = covariance[:, 3] / covariance[3, 3]
    sd = math.sqrt(covariance[3, 3])
    turns = sd * np.linspace(-4, 4, 17)
    values = []
    for turn in turns:
        candidate = best.candidate + turn * line
        found = site.likelihood(walkers, candidate)
        values.append(found.value / temper + belief.log_density(candidate))
    chances = np.exp(np.array(values) - max(values))
    variance = float(chances @ turns**2 / chances.sum())
    return np.asarray(max(variance - sd**2, 0.0) * np.outer(line, line))
