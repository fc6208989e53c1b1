"""Reasons of a verdict and of a chart result: codes and values."""

import math
from datetime import UTC, datetime

from models.durations import DAY_S
from models.geometry.pose import ANGLES, PARAMETERS, PLANE_PARAMETERS, CameraPose
from models.monitoring.chart import CLOCK, ChartResult
from models.monitoring.config import (
    CLOCK_LEAST_LOG,
    CLOCK_SIGMAS,
    GROUPS_FOR_POSE,
    STILL_RAD,
    STILL_SIGMAS,
    USUAL_RATE_HZ,
)
from models.monitoring.creep import Creep
from models.monitoring.verdict import Drift, DriftLimits, DriftVerdict
from models.reasons import Reason, TracksCode, Value

_HEIGHT = 2


def reason_of_drift(drift: Drift, verdict: DriftVerdict, limits: DriftLimits) -> Reason | None:
    """The identifiable parameters against the prior pose and the limits; None where none is."""
    values: dict[str, Value] = {
        "sigmas": limits.sigmas,
        "floor_rad": limits.floor_rad,
        "floor_m": limits.floor_m,
        "people": limits.people,
        "clear_ratio": limits.clear_ratio,
    }
    if not drift.identifiable:
        code = TracksCode.BEYOND_LIMITS_LAST_IDENTIFIABLE
        return Reason(code=code, values=values) if verdict.drifting else None
    for name in drift.identifiable:
        unit = "m" if name == "height" else "rad"
        values[f"{name}_{unit}"], values[f"{name}_sd_{unit}"] = drift.of(name)
    beyond = verdict.excess >= 1
    if verdict.drifting:
        code = TracksCode.BEYOND_LIMITS if beyond else TracksCode.BEYOND_LIMITS_BEFORE
    else:
        code = TracksCode.BEYOND_LIMITS_UNCONFIRMED if beyond else TracksCode.WITHIN_LIMITS
    return Reason(code=code, values=values)


def reason_of_chart(chart: ChartResult) -> Reason | None:
    """Direction in which the drift chart takes the camera to have moved; None where it is calm.

    Its `number` is a parameter of a pose, or `times` where all were too long (`sign` 1) or too
    short (-1).
    """
    if not chart.suspicious:
        return None
    parameter = "times" if chart.parameter == CLOCK else PARAMETERS[chart.parameter]
    values: dict[str, Value] = {
        "number": parameter,
        "sign": chart.sign,
        "parties": chart.walking_groups,
        "statistic": chart.statistic,
        "level": chart.level,
    }
    return Reason(code=TracksCode.CHART, values=values)


def reason_of_creep(creep: Creep) -> Reason | None:
    """Direction, size and beginning of a camera's creep; None where it has not crept.

    `since` is a time, as of `datetime.isoformat`.
    """
    if not creep.moved:
        return None
    values: dict[str, Value] = {
        "number": PARAMETERS[creep.parameter],
        "by_rad": creep.by,
        "sd_rad": creep.sd,
        "since": datetime.fromtimestamp(creep.since_day * DAY_S, UTC).isoformat(),
        "statistic": creep.statistic,
        "level": creep.level,
    }
    return Reason(code=TracksCode.CREPT, values=values)


def may_be_clock(chart: ChartResult) -> bool:
    """True where an alarm may be of the clock, after too few walking groups for the pose to decide.

    An alarm about a scale that waits for a few more people can be called what it is.
    """
    return chart.parameter in (_HEIGHT, CLOCK) and chart.walking_groups < GROUPS_FOR_POSE


def clock_fault(drift: Drift, prior: CameraPose, frame_rate_hz: float | None) -> Reason | None:
    """Reason of a change of scale with unchanged angles; None where there is none.

    Times that are too long by a factor make people slow, and only a higher camera makes them walk
    as before: the height grows by that factor and nothing else does. A camera that was raised
    without turning looks the same.

    Args:
        drift: the estimate against the prior pose.
        prior: that pose.
        frame_rate_hz: what the camera is said to have; 25 frames a second where nobody says.
    """
    if not set(PLANE_PARAMETERS) <= set(drift.identifiable):
        return None
    factor = 1 + drift.by.height_m / prior.height_m
    relative_sd = drift.sd.height_m / (factor * prior.height_m)
    if abs(math.log(factor)) <= max(CLOCK_SIGMAS * relative_sd, CLOCK_LEAST_LOG):
        return None
    for angle, sd in (drift.of(name) for name in ANGLES if name in drift.identifiable):
        if abs(angle) > min(STILL_SIGMAS * sd, STILL_RAD):
            return None
    values = {"factor": factor, "rate_hz": frame_rate_hz or USUAL_RATE_HZ}
    return Reason(code=TracksCode.SCALE_CHANGED, values=values)
