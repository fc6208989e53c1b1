"""The drift in words: what is told, how sure it is, and what it is held against."""

from models.drift.chart import CLOCK, Reading
from models.drift.verdict import Drift, DriftLimits, DriftVerdict
from models.estimation.numbers import WITH_HEADING
from service.formats.degrees import degrees

# The numbers of a pose as fields of JSON.
FIELDS = {"height": "height_m", "tilt": "tilt_deg", "roll": "roll_deg", "heading": "heading_deg"}


def describe_drift(drift: Drift, verdict: DriftVerdict, limits: DriftLimits) -> str:
    """The told numbers against the prior pose and the limits; empty where none is told."""
    limit = f"{limits.sigmas:g} sd and {degrees(limits.floor_rad):g} deg or {limits.floor_m:g} m"
    if not drift.told:
        return f"beyond {limit} when it was last told" if verdict.drifting else ""
    text = ", ".join(_said(drift, name) for name in drift.told) + " against the prior pose"
    hold = f"without the newest {limits.people} people"
    if verdict.drifting and verdict.excess >= 1:
        return f"{text}: beyond {limit}"
    if verdict.drifting:
        share = f"{100 * limits.clear_ratio:g} % of that, and so {hold}"
        return f"{text}: was beyond {limit}; it ends once all is below {share}"
    if verdict.excess >= 1:
        return f"{text}: beyond {limit}, but not so {hold}"
    return f"{text}: not beyond {limit}"


def describe_reading(reading: Reading) -> str:
    """Which way the drift chart says that a camera has moved; empty where it says nothing."""
    if not reading.suspicious:
        return ""
    if reading.number == CLOCK:
        what = f"all times were too {'long' if reading.sign > 0 else 'short'}"
    else:
        way = "up" if reading.sign > 0 else "down"
        what = f"the {WITH_HEADING[reading.number]} had gone {way}"
    return (
        f"the last {reading.parties} parties walk as they would if {what} "
        f"(drift chart: {reading.statistic:.0f}, alarm at {reading.level:.0f})"
    )


def shown(name: str, value: float) -> float:
    """A number of a pose in the unit of its field."""
    return value if name == "height" else degrees(value)


def _said(drift: Drift, name: str) -> str:
    value, sd = drift.of(name)
    if name == "height":
        return f"height {value:+.2f} m (sd {sd:.2f})"
    return f"{name} {shown(name, value):+.2f} deg (sd {shown(name, sd):.2f})"
