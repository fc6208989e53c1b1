"""Stage 4, decide: the camera's state, its verdict, the cause and the time of a move."""

import numpy as np

from models.assessment.scale_faults import (
    charted_clock,
    clock_fault,
    may_be_clock,
    reason_of_causes,
)
from models.assessment.values import (
    FIRST_STATE,
    NO_TIME,
    NO_VERDICT,
    AssessmentLimits,
    AssessmentState,
    CameraState,
    Decision,
    Observed,
    TimeSpan,
    Verdict,
)
from models.assessment.verdict import judge
from models.durations import DAY_S
from models.geometry.pose import ANGLES, PARAMETERS
from models.monitoring.chart import ChartResult
from models.monitoring.drift import LIKELY
from models.monitoring.slow_drift import SlowDrift
from models.pose import config
from models.pose.estimating import PoseFinding
from models.pose.hypotheses import PosePosterior
from models.pose.move_time import MovedBetween
from models.pose.pose_fit import FusedEstimate
from models.reasons import Reason


def decide(
    observed: Observed,
    found: PoseFinding,
    chart: ChartResult | None,
    slow_drift: SlowDrift | None,
    *,
    mapped: bool,
    state: AssessmentState,
    limits: AssessmentLimits,
) -> Decision:
    """Decide on a window.

    `mapped` is whether the site has a map of paths: without one a turn in heading stays unseen.
    """
    posterior, drift, rate_hz = found.posterior, found.drift, limits.frame_rate_hz
    named = reason_of_causes(
        found.causes, posterior.moved, limits.drift.certainty, rate_hz, state.drifted
    )
    cause = named
    if found.causes is None:
        cause = clock_fault(drift, posterior.turned, found.prior, rate_hz)
    counting = _counting_chart(chart, posterior, cause, state)
    verdict = judge(
        drift,
        limits.drift,
        state.drifted,
        counting,
        slow_drift,
        enough=observed.enough or posterior.pictured,
        scaled=named is not None,
    )
    camera = state_of(
        posterior, found.fused, verdict, enough=observed.enough, mapped=mapped, carried=state
    )
    if cause is None and counting is not None and verdict.alarmed:
        cause = charted_clock(counting, posterior.turned)
    moved_at = _moved_at(observed, found, slow_drift, verdict, camera, state)
    return Decision(state=camera, verdict=verdict, cause=cause, moved_at=moved_at)


def state_of(
    posterior: PosePosterior,
    fused: FusedEstimate,
    verdict: Verdict = NO_VERDICT,
    *,
    enough: bool = True,
    mapped: bool = True,
    carried: AssessmentState = FIRST_STATE,
) -> CameraState:
    """The state of a camera: the first rule that holds, else `learning`.

    An image decides alone whether the camera moved. Before enough people came since an operator's
    answer, that answer holds. Unused paths count as unused until people are seen there again.
    """
    moved = posterior.moved >= LIKELY
    seen_again = enough and (fused.registered or not mapped)
    stationary = not moved and is_detectable(posterior, fused, mapped=mapped)
    rules = (
        (verdict.drifting, CameraState.DRIFTING),
        (posterior.pictured, CameraState.SUSPECTED if moved else CameraState.OK),
        (carried.unsure and not seen_again, CameraState.UNSURE),
        (fused.paths_changed and enough, CameraState.UNSURE),
        (moved and enough and not fused.paths_changed, CameraState.SUSPECTED),
        (stationary and not fused.paths_changed, CameraState.OK),
        (not enough and carried.false_alarm, CameraState.OK),
    )
    return next((found for holds, found in rules if holds), CameraState.LEARNING)


def is_site_changed(posterior: PosePosterior, fused: FusedEstimate) -> bool:
    """True if an image shows a stationary camera while people walk elsewhere."""
    stationary = posterior.pictured and posterior.moved < LIKELY
    return stationary and (fused.paths_changed or posterior.site_changed >= LIKELY)


def is_detectable(posterior: PosePosterior, fused: FusedEstimate, *, mapped: bool) -> bool:
    """True if a turn of 12 deg would have been detected, and none of 5 deg is possible.

    Of a site that is `mapped`, in heading too.
    """
    angles = [name for name in ANGLES if mapped or name != "heading"]
    sds = np.sqrt(np.diag(fused.covariance))
    if not fused.identifiable or (mapped and not fused.registered) or fused.paths_changed:
        return False
    detected = all(sds[PARAMETERS.index(name)] < config.NOTICED_SD for name in angles)
    ends = [abs(end) for name in angles for end in posterior.interval(name, 0.9)]
    return detected and max(ends) < config.NOTICED_RAD


def _counting_chart(
    chart: ChartResult | None,
    posterior: PosePosterior,
    cause: Reason | None,
    state: AssessmentState,
) -> ChartResult | None:
    """The drift chart's result, unless something else than a move explains it."""
    if chart is None or (cause is None and not state.drifted and may_be_clock(chart)):
        return None
    if posterior.pictured and posterior.moved < LIKELY:
        return None  # people changed their ways in front of a stationary camera
    return chart


def _moved_at(
    observed: Observed,
    found: PoseFinding,
    slow_drift: SlowDrift | None,
    verdict: Verdict,
    camera: CameraState,
    state: AssessmentState,
) -> TimeSpan:
    """The time of a move, or of a suspected one; unknown until 12 people came after it."""
    reported = state.moved_at or NO_TIME
    if verdict.streak <= 0 and camera != CameraState.SUSPECTED:
        return reported if verdict.drifting else NO_TIME
    change = change_in(observed, found) or state.change
    if change is not None and change.after_s is not None:
        return _in_order(change)
    if found.between is not None and (found.between.first or reported.before_s is None):
        span = times_of(observed, found.between)
        if span.after_s is None:
            span = TimeSpan(state.stationary_until_s, span.before_s)
        return _in_order(span)
    if reported.before_s is None and slow_drift is not None and slow_drift.moved:
        return TimeSpan(None, slow_drift.since_day * DAY_S)
    return reported


def change_in(observed: Observed, found: PoseFinding) -> TimeSpan | None:
    """The time of the change that was found in a window; None without one.

    Its beginning is None if too few people came after it to know.
    """
    if found.change_idx is None:
        return None
    if found.between is not None:
        return times_of(observed, found.between)
    return TimeSpan(None, observed.started_s[found.change_idx])


def times_of(observed: Observed, between: MovedBetween) -> TimeSpan:
    """The times after and before which a camera moved; the first is None before all tracks.

    Tracks overlap in time: of the last before the move and the first after it, either may have
    begun or ended first.
    """
    first, last = between.first, between.last
    started_s, ended_s = observed.started_s, observed.ended_s
    before_s = max(started_s[last], ended_s[last - 1]) if last else started_s[last]
    return TimeSpan(min(ended_s[first - 1], started_s[first]) if first else None, before_s)


def _in_order(span: TimeSpan) -> TimeSpan:
    """The span of a move; tracks overlap, so that either end may be the earlier one."""
    after_s, before_s = span
    if after_s is None or before_s is None:
        return span
    return TimeSpan(min(after_s, before_s), max(after_s, before_s))
