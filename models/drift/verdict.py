"""A first drift test: estimate against prior pose, with a floor, a hold and hysteresis."""

import math
from dataclasses import dataclass

from models.estimation.averaged import PoseEstimate, pose_of
from models.geometry.pose import CameraPose
from models.geometry.rotation import angle_between


@dataclass(frozen=True, slots=True, kw_only=True)
class Drift:
    """Estimate minus prior pose; `angle_rad` is the whole rotation between the two."""

    height_m: float
    tilt_rad: float
    roll_rad: float
    angle_rad: float


@dataclass(frozen=True, slots=True, kw_only=True)
class DriftLimits:
    """When a drift counts: beyond so many standard deviations and beyond a floor, for a while."""

    sigmas: float
    floor_rad: float
    floor_m: float
    updates: int
    clear_ratio: float


@dataclass(frozen=True, slots=True, kw_only=True)
class DriftVerdict:
    """`streak` is how many updates in a row were beyond the limits, negative how many below them.

    `excess` is the largest drift in units of its limit: 1 and more is beyond.
    """

    streak: int
    excess: float
    drifting: bool


def drift_between(estimate: PoseEstimate, prior: CameraPose) -> Drift:
    """How far the estimate is from the prior pose; x, y and heading count as unmoved."""
    pose = pose_of(estimate, prior)
    return Drift(
        height_m=pose.height_m - prior.height_m,
        tilt_rad=pose.tilt_rad - prior.tilt_rad,
        roll_rad=math.remainder(pose.roll_rad - prior.roll_rad, 2 * math.pi),
        angle_rad=float(angle_between(pose.quaternion_wxyz, prior.quaternion_wxyz)),
    )


def judge(
    drift: Drift, estimate: PoseEstimate, limits: DriftLimits, streak: int, drifting: bool
) -> DriftVerdict:
    """The verdict of one more update, given the streak so far and whether it was drifting.

    Drifting begins after `updates` in a row beyond the limits and ends after as many below
    `clear_ratio` of them; what lies between ends either streak.
    """
    floors = (
        (drift.height_m, estimate.height_sd_m, limits.floor_m),
        (drift.tilt_rad, estimate.tilt_sd_rad, limits.floor_rad),
        (drift.roll_rad, estimate.roll_sd_rad, limits.floor_rad),
    )
    excess = max(abs(value) / max(limits.sigmas * sd, floor, 1e-12) for value, sd, floor in floors)
    if excess >= 1:
        streak = max(streak, 0) + 1
    elif excess < limits.clear_ratio:
        streak = min(streak, 0) - 1
    else:
        streak = 0
    drifting = streak > -limits.updates if drifting else streak >= limits.updates
    return DriftVerdict(streak=streak, excess=excess, drifting=drifting)
