"""Reasons of single results: the drift, the chart, the slow drift."""

from datetime import UTC, datetime

from models.assessment.values import Verdict
from models.durations import DAY_S
from models.geometry.pose import PARAMETERS
from models.monitoring.chart import CLOCK, ChartResult
from models.monitoring.drift import LIKELY, Drift, DriftLimits
from models.monitoring.slow_drift import SlowDrift
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


def reason_of_slow_drift(slow_drift: SlowDrift) -> Reason | None:
    """Direction, size and start of a camera's slow drift; None if there is none.

    `since` is a time, as of `datetime.isoformat`.
    """
    if not slow_drift.moved:
        return None
    values: dict[str, Value] = {
        "number": PARAMETERS[slow_drift.parameter],
        "by_rad": slow_drift.by,
        "sd_rad": slow_drift.sd,
        "since": datetime.fromtimestamp(slow_drift.since_day * DAY_S, UTC).isoformat(),
        "statistic": slow_drift.statistic,
        "level": slow_drift.level,
    }
    return Reason(code=TracksCode.SLOW_DRIFT, values=values)
