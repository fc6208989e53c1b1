"""What a verdict and a chart give as their reason: codes and values."""

from datetime import UTC, datetime

from models.durations import DAY_S
from models.geometry.pose_parameters import PARAMETERS
from models.monitoring.chart import CLOCK, Reading
from models.monitoring.creep import Creep
from models.monitoring.verdict import Drift, DriftLimits, DriftVerdict
from models.reasons import Reason, TracksCode, Value


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


def reason_of_reading(reading: Reading) -> Reason | None:
    """Which way the drift chart says that a camera has moved; None where it says nothing.

    Its `number` is a parameter of a pose, or `times` where all were too long (`sign` 1) or too
    short (-1).
    """
    if not reading.suspicious:
        return None
    parameter = "times" if reading.parameter == CLOCK else PARAMETERS[reading.parameter]
    values: dict[str, Value] = {
        "number": parameter,
        "sign": reading.sign,
        "parties": reading.walking_groups,
        "statistic": reading.statistic,
        "level": reading.level,
    }
    return Reason(code=TracksCode.CHART, values=values)


def reason_of_creep(creep: Creep) -> Reason | None:
    """Which way a camera has crept, how far and since when; None where it has not.

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
