"""The fused pose: the joint estimate's speeds and the flow map's places, in one posterior."""

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from models.estimation.joint.estimate import JointEstimate
from models.estimation.joint.observations import Observations
from models.flow.evidence import walkers_of
from models.flow.reference import FlowReference
from models.flow.registration import Belief, Peak, register
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array

_HEADINGS = np.radians(np.arange(-30.0, 31.0, 2.0))
_HEADING_SD = math.radians(15.0)  # a knock's, before any track is seen
_FEWEST = 5
_CONFLICT = 3.0  # squared standard deviations of the joint estimate, in three numbers
_TRUST = 25.0


@dataclass(frozen=True, slots=True, kw_only=True)
class FusedEstimate:
    """Tilt, roll, log height, heading (4,) with their covariance (4, 4).

    `rivals` are headings (radians) of other poses that explain the tracks about as well.
    """

    values: Array
    covariance: Array
    rivals: tuple[float, ...]


def fused_estimate(
    observations: Observations,
    intrinsics: Intrinsics,
    prior: CameraPose,
    joint: JointEstimate,
    reference: FlowReference,
) -> FusedEstimate | None:
    """The pose by speeds and places together; None where fewer than 5 people walk.

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
    if walkers.people < _FEWEST:
        return None
    search = partial(
        register,
        walkers,
        reference.flow,
        reference.coverage,
        intrinsics,
        temper=reference.temper,
        headings=_HEADINGS,
    )
    peaks = search(Belief(mean=mean, precision=precision))
    apart = (peaks[0].candidate - mean)[:3]
    if float(apart @ precision[:3, :3] @ apart) > _CONFLICT:
        # Speeds and places contradict one another; speeds are the better proven of the two.
        precision[:3, :3] *= _TRUST
        peaks = search(Belief(mean=mean, precision=precision))
        precision[:3, :3] /= _TRUST
    best = peaks[0]
    own = np.linalg.inv(best.information / reference.temper + precision)
    # Of the offset only as much is unsure as the map decides.
    share = own @ (best.information / reference.temper)
    covariance = own + share @ reference.offset_covariance @ share.T + _elsewhere(peaks)
    return FusedEstimate(
        values=best.candidate - reference.offset,
        covariance=covariance,
        rivals=tuple(
            float(peak.candidate[3] - reference.offset[3])
            for peak in peaks[1:]
            if peak.value > best.value - 3.0
        ),
    )


def _elsewhere(peaks: list[Peak]) -> Array:
    """What other peaks add to the covariance (4, 4)."""
    chances = np.exp([peak.value - peaks[0].value for peak in peaks])
    apart = np.array([peak.candidate - peaks[0].candidate for peak in peaks])
    return np.asarray((apart * (chances / chances.sum())[:, None]).T @ apart)
