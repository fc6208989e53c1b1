"""The pose by speeds and paths together, where there is a map of the paths; else by speeds alone.

What `models/flow` is asked for goes through here, and nowhere else.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from models.estimation.joint.estimate import JointEstimate
from models.estimation.joint.observations import Observations
from models.estimation.numbers import NUMBERS
from models.flow.fusion import fused_estimate
from models.flow.reference import FlowReference, learn_flow
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose

Array = npt.NDArray[np.float64]

_UNKNOWN_SD_RAD = math.radians(15.0)  # of a heading that nothing tells
_TELLING_SD_RAD = math.radians(2.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class FusedPose:
    """Tilt, roll, log height, heading (4,) with their covariance (4, 4).

    `told` names those of tilt, roll, height, heading that the tracks can tell; `reason` says what
    is to be said of the map, `registered` whether it had a part.
    """

    values: Array
    covariance: Array
    told: tuple[str, ...]
    reason: str
    registered: bool


def fuse(
    observations: Observations,
    intrinsics: Intrinsics,
    prior: CameraPose,
    joint: JointEstimate,
    flow: FlowReference | None,
) -> FusedPose:
    """The served pose of tracks that a joint estimate was made of."""
    if flow is None or set(joint.weak) == set(NUMBERS):
        return by_speeds_alone(joint, prior)
    found = fused_estimate(observations, intrinsics, prior, joint, flow)
    if found is None:
        return by_speeds_alone(joint, prior)
    told = tuple(name for name in NUMBERS if name not in joint.weak)
    if not found.rivals and math.sqrt(found.covariance[3, 3]) < _TELLING_SD_RAD:
        told = (*told, "heading")
    return FusedPose(
        values=found.values, covariance=found.covariance, told=told, reason="", registered=True
    )


def by_speeds_alone(joint: JointEstimate, prior: CameraPose) -> FusedPose:
    """The joint estimate with the prior's heading, which it cannot tell."""
    covariance = np.zeros((4, 4))
    covariance[:3, :3] = joint.covariance
    covariance[3, 3] = _UNKNOWN_SD_RAD**2
    return FusedPose(
        values=np.append(joint.values, prior.heading_rad),
        covariance=covariance,
        told=tuple(name for name in NUMBERS if name not in joint.weak),
        reason="",
        registered=False,
    )


def learn_paths(
    observations: Observations,
    intrinsics: Intrinsics,
    prior: CameraPose,
    seed: int,
    weights: Array | None = None,
) -> FlowReference | None:
    """The flow of tracks at the prior pose, older ones counted by their weights (N,)."""
    return learn_flow(observations, intrinsics, prior, seed)
