"""Reasons of single results: the drift, the chart, the slow drift."""

from datetime import UTC, datetime

from models.assessment.values import Verdict
from models.durations import DAY_S
from models.geometry.pose import PARAMETERS
from models.monitoring.chart import CLOCK, ChartResult
from models.monitoring.creep import Creep
from models.monitoring.drift import LIKELY, Drift, DriftLimits
from models.reasons import Reason, TracksCode, Value


def reason_of_drift(drift: Drift, verdict: Verdict, limits: DriftLimits) -> Reason | None:
    """The identifiable drift beside the limits; None if nothing is identifiable."""
    values: dict[str, Value] = {
        "moved": drift.move.moved,
        "certainty": limits.certainty,
        "floor_rad": limits.floor_rad,
        "floor_m": limits.floor_m,
    }
    if not drift.identifiable and verdict.excess < 1:
        code = TracksCode.BEYOND_LIMITS_LAST_IDENTIFIABLE
        return Reason(code=code, values=values) if verdict.drifting else None
    for name in drift.identifiable:
        unit = "m" if name == "height" else "rad"
        values[f"{name}_{unit}"], values[f"{name}_sd_{unit}"] = drift.of(name)
    if verdict.drifting:
        beyond = verdict.excess >= 1
        code = TracksCode.BEYOND_LIMITS if beyond else TracksCode.BEYOND_LIMITS_BEFORE
    else:
        code = TracksCode.SUSPECTED if drift.move.moved >= LIKELY else TracksCode.WITHIN_LIMITS
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


def reason_of_slow_drift(creep: Creep) -> Reason | None:
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
    return Reason(code=TracksCode.SLOW_DRIFT, values=values)
