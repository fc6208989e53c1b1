"""The verdict on a drift: at once by an alarm, and by what certainly moved, with hysteresis."""

from models.assessment.values import Verdict
from models.geometry.pose import ANGLES, PARAMETERS
from models.monitoring import config
from models.monitoring.chart import ChartResult
from models.monitoring.drift import LIKELY, Drift, DriftLimits
from models.monitoring.slow_drift import SlowDrift

# A wrong clock looks like another height.
_CHARTED = (*PARAMETERS, "height")


def judge(
    drift: Drift,
    limits: DriftLimits,
    drifted: tuple[str, ...],
    chart: ChartResult | None = None,
    slow_drift: SlowDrift | None = None,
    *,
    enough: bool = True,
    scaled: bool = False,
) -> Verdict:
    """Judge a window, given the parameters that had `drifted` before.

    A drift begins at once if the slow drift is beyond its level, or the chart is and the pose of
    its tracks confirms it; and if the camera certainly moved, by more than the floor. It ends if a
    move is unlikely, or all drifts are below `clear_ratio`, while the chart and the slow drift are
    calm. A parameter that is not identifiable is never beyond, and its drift does not end until it
    is identifiable again or the chart, which tests all four, is calm. With nothing identifiable,
    nothing changes.

    Before `enough` people came since an operator's answer, the pose neither begins nor ends a
    drift. A wrong clock or lens of a stationary camera counts as a drift in height (`scaled`).
    """
    crept = (
        () if slow_drift is None or not slow_drift.moved else (PARAMETERS[slow_drift.parameter],)
    )
    if not crept and scaled and enough:
        crept = ("height",)
    beyond = _beyond(drift, limits) if enough else {}
    if not drift.identifiable and chart is None and not crept and not beyond:
        return Verdict(streak=0, excess=0.0, drifted=drifted)
    charted = chart is not None and chart.moved and _confirms(drift, limits)
    alarmed = (_CHARTED[chart.parameter],) if chart is not None and charted else crept
    calm = all(each is None or each.excess < limits.clear_ratio for each in (chart, slow_drift))
    known = set(drift.identifiable) if chart is None else set(PARAMETERS)
    well = enough and calm and set(drifted) <= known and _is_well(drift, limits)
    streak = 1 if beyond or alarmed else -1 if well else 0
    if not drifted:
        drifted = tuple(beyond) or alarmed
    elif streak < 0:
        drifted = ()
    else:
        drifted = tuple(name for name in PARAMETERS if name in drifted or name in beyond)
    return Verdict(
        streak=streak,
        excess=max(beyond.values(), default=0.0),
        drifted=drifted,
        alarmed=bool(alarmed),
    )


def may_be_alerted(
    moved: float, limits: DriftLimits, slow_drift: SlowDrift | None, *, alerted: bool
) -> bool:
    """False if `judge` cannot find a drift. `alerted` is whether an alert is open already."""
    crept = slow_drift is not None and slow_drift.moved
    return alerted or crept or moved >= min(config.BORNE_OUT, limits.certainty)


def _confirms(drift: Drift, limits: DriftLimits) -> bool:
    """True if the pose confirms an alarm of the chart.

    A height within its floor alone does not: people who hurry for an hour look the same.
    """
    angle = max(drift.move.parameters[name] for name in ANGLES)
    other = angle >= LIKELY or drift.ratio("height", limits) >= 1
    return drift.move.moved >= config.BORNE_OUT and other


def _beyond(drift: Drift, limits: DriftLimits) -> dict[str, float]:
    """The parameters of a camera that certainly moved, beyond their floors, in units of these.

    Each of them more likely moved than not. A heading may be one although its size is unknown: it
    counts as just beyond.
    """
    moved = drift.move
    if moved.moved < limits.certainty:
        return {}
    ratios = drift.ratios(limits)
    if "heading" not in ratios:
        ratios["heading"] = min(drift.ratio("heading", limits), 1.0)
    return {n: r for n, r in ratios.items() if r >= 1 and moved.parameters[n] >= LIKELY}


def _is_well(drift: Drift, limits: DriftLimits) -> bool:
    largest = max(drift.ratios(limits).values(), default=0.0)
    return drift.move.moved < LIKELY or largest < limits.clear_ratio
