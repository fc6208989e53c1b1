"""Clock and lens faults: a scale that changed while the angles did not."""

import math

from models.assessment.reasons import reason_of_chart
from models.geometry.pose import PARAMETERS, PLANE_PARAMETERS, CameraPose
from models.monitoring import config
from models.monitoring.chart import CLOCK, ChartResult
from models.monitoring.drift import LIKELY, Drift
from models.pose.causes import Cause
from models.pose.config import CAUSE_NAMED
from models.reasons import Reason, TracksCode


def reason_of_causes(
    causes: tuple[Cause, Cause] | None,
    moved: float,
    certainty: float,
    frame_rate_hz: float | None,
    drifted: tuple[str, ...] = (),
) -> Reason | None:
    """The reason of a wrong clock or another lens; None if a move, or nothing, explains as much.

    `moved` is the probability of any change: of a certain change the name need not be as certain. A
    fault that was reported before, as a drift in height alone, lasts while it is more likely than
    not.
    """
    if causes is None:
        return None
    certainty = LIKELY if drifted == ("height",) else certainty
    clock, lens = causes
    wanted = min(CAUSE_NAMED, certainty) if moved >= certainty else certainty
    if max(clock.probability, lens.probability) < wanted:
        return None
    if clock.probability >= lens.probability:
        return reason_of_scale(clock.factor, frame_rate_hz)
    return Reason(code=TracksCode.LENS_CHANGED, values={"factor": lens.factor})


def may_be_clock(chart: ChartResult) -> bool:
    """True if an alarm may be of the clock, after too few walking groups for the pose to decide.

    An alarm about a scale that waits for a few more people gets its right name.
    """
    return (
        chart.parameter in (PARAMETERS.index("height"), CLOCK)
        and chart.walking_groups < config.GROUPS_FOR_POSE
    )


def charted_clock(chart: ChartResult, turned: float) -> Reason | None:
    """Reason of an alarm about times; None of one about the pose, or if an angle changed.

    `turned` is the probability that one did, given a move.
    """
    if chart.parameter != CLOCK or turned > config.CLOCK_TURNED:
        return None
    return reason_of_chart(chart)


def clock_fault(
    drift: Drift, turned: float, prior: CameraPose, frame_rate_hz: float | None
) -> Reason | None:
    """Reason of a change of scale with unchanged angles; None if there is none.

    Times that are too long by a factor make people slow, and only a higher camera makes them walk
    as before: the height grows by that factor and nothing else does. A camera that was raised
    without turning looks the same. If the camera may have turned, the clock is not the cause.

    `turned` is the probability that an angle changed, given a move. Without a `frame_rate_hz` it
    is 25.
    """
    if not set(PLANE_PARAMETERS) <= set(drift.identifiable):
        return None
    factor = 1 + drift.by.height_m / prior.height_m
    changed = drift.move.moved >= LIKELY and drift.move.parameters["height"] >= LIKELY
    if not changed or turned > config.CLOCK_TURNED:
        return None
    return reason_of_scale(factor, frame_rate_hz)


def reason_of_scale(factor: float, frame_rate_hz: float | None) -> Reason | None:
    """Reason of times that are too long by a factor; None if people's habits explain it."""
    if abs(math.log(factor)) <= config.CLOCK_LEAST_LOG:
        return None
    values = {"factor": factor, "rate_hz": frame_rate_hz or config.USUAL_RATE_HZ}
    return Reason(code=TracksCode.SCALE_CHANGED, values=values)
