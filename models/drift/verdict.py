"""The verdict: by the chart at once, by the told pose after a hold; with hysteresis."""

import math
from dataclasses import dataclass, replace

import numpy as np

from models.drift.chart import Reading
from models.estimation.numbers import WITH_HEADING
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array, angle_between

# What a clock that is wrong looks like in a pose is a height.
_CHARTED = (*WITH_HEADING, "height")


@dataclass(frozen=True, slots=True, kw_only=True)
class Drift:
    """Estimate minus prior pose, each number with the standard deviation of the estimate.

    `told` names those of tilt, roll, height, heading that the tracks can tell; the others stand
    here but count nowhere. `angle_rad` is the whole rotation between prior and `pose_after`.
    """

    tilt_rad: float
    roll_rad: float
    height_m: float
    log_height: float
    heading_rad: float
    angle_rad: float
    tilt_sd_rad: float
    roll_sd_rad: float
    height_sd_m: float
    log_height_sd: float
    heading_sd_rad: float
    told: tuple[str, ...]

    def of(self, name: str) -> tuple[float, float]:
        """A number's drift and its standard deviation: in metres for height, else in radians."""
        return {
            "tilt": (self.tilt_rad, self.tilt_sd_rad),
            "roll": (self.roll_rad, self.roll_sd_rad),
            "height": (self.height_m, self.height_sd_m),
            "heading": (self.heading_rad, self.heading_sd_rad),
        }[name]


@dataclass(frozen=True, slots=True, kw_only=True)
class DriftLimits:
    """When a drift counts: beyond so many standard deviations and beyond a floor, for a while."""

    sigmas: float
    floor_rad: float
    floor_m: float
    updates: int
    clear_ratio: float

    def of(self, name: str, sd: float) -> float:
        """From where on a number's drift counts, given its standard deviation."""
        floor = self.floor_m if name == "height" else self.floor_rad
        return max(self.sigmas * sd, floor, 1e-12)


@dataclass(frozen=True, slots=True, kw_only=True)
class DriftVerdict:
    """`streak` is how many updates in a row were beyond the limits, negative how many below them.

    `excess` is the largest told drift in units of its limit: 1 and more is beyond. `drifted` names
    the numbers that have been beyond since the drift began; empty where there is none.
    """

    streak: int
    excess: float
    drifted: tuple[str, ...]

    @property
    def drifting(self) -> bool:
        """Whether the camera has moved, by now."""
        return bool(self.drifted)


def drift_between(
    values: Array, covariance: Array, told: tuple[str, ...], prior: CameraPose
) -> Drift:
    """How far an estimate is from the prior pose; x and y count as unmoved.

    Args:
        values: tilt, roll (radians), log height, heading (radians) (4,).
        covariance: of these (4, 4).
        told: those of tilt, roll, height, heading that the tracks can tell.
        prior: the prior pose.
    """
    tilt, roll, log_height, heading = (float(value) for value in values)
    tilt_sd, roll_sd, log_height_sd, heading_sd = map(float, np.sqrt(np.diag(covariance)))
    height_m = math.exp(log_height)
    drift = Drift(
        tilt_rad=min(max(tilt, -math.pi / 2), math.pi / 2) - prior.tilt_rad,
        roll_rad=math.remainder(roll - prior.roll_rad, 2 * math.pi),
        height_m=height_m - prior.height_m,
        log_height=log_height - math.log(prior.height_m),
        heading_rad=math.remainder(heading - prior.heading_rad, 2 * math.pi),
        angle_rad=0.0,
        tilt_sd_rad=tilt_sd,
        roll_sd_rad=roll_sd,
        height_sd_m=height_m * log_height_sd,
        log_height_sd=log_height_sd,
        heading_sd_rad=heading_sd,
        told=tuple(name for name in WITH_HEADING if name in told),
    )
    turned = pose_after(drift, prior)
    return replace(
        drift, angle_rad=float(angle_between(turned.quaternion_wxyz, prior.quaternion_wxyz))
    )


def pose_after(drift: Drift, prior: CameraPose) -> CameraPose:
    """The prior pose moved by what is told of the drift; what is not told stays the prior's."""
    turn = 2 * math.pi
    by = {name: drift.of(name)[0] if name in drift.told else 0.0 for name in WITH_HEADING}
    heading = prior.heading_rad + by["heading"]
    return replace(
        prior,
        height_m=prior.height_m + by["height"],
        tilt_rad=prior.tilt_rad + by["tilt"],
        roll_rad=prior.roll_rad + by["roll"],
        # Within one turn, as a prior pose has to be.
        heading_rad=heading if abs(heading) <= turn else math.fmod(heading, turn),
    )


def judge(
    drift: Drift,
    limits: DriftLimits,
    streak: int,
    drifted: tuple[str, ...],
    reading: Reading | None = None,
) -> DriftVerdict:
    """The verdict of one more update, given the streak so far and what had drifted before.

    Drifting begins at once where the chart is beyond its level, and after `updates` in a row where
    a told number is beyond its limit: the chart's level is of a rate of false alarms already, and
    far moves, which the chart is not made for, are told by the pose. It ends after `updates` in
    a row with both below `clear_ratio`; what lies between ends either streak. A number that the
    tracks cannot tell is never beyond, and its drift does not end until it is told again or the
    chart, which asks for all four, is calm. Where nothing is told, nothing changes.
    """
    ratios = {}
    for name in drift.told:
        value, sd = drift.of(name)
        ratios[name] = abs(value) / limits.of(name, sd)
    if not ratios and reading is None:
        return DriftVerdict(streak=streak, excess=0.0, drifted=drifted)
    excess = max(ratios.values(), default=0.0)
    beyond = tuple(name for name, ratio in ratios.items() if ratio >= 1)
    charted = (_CHARTED[reading.number],) if reading is not None and reading.moved else ()
    calm = reading is None or reading.excess < limits.clear_ratio
    told = set(drift.told) if reading is None else set(WITH_HEADING)
    if beyond or charted:
        streak = max(streak, 0) + 1
    elif excess < limits.clear_ratio and calm and set(drifted) <= told:
        streak = min(streak, 0) - 1
    else:
        streak = 0
    if drifted:
        drifted = tuple(n for n in WITH_HEADING if n in drifted or n in beyond)
        drifted = () if streak <= -limits.updates else drifted
    elif charted or streak >= limits.updates:
        drifted = beyond or charted
    return DriftVerdict(streak=streak, excess=excess, drifted=drifted)
