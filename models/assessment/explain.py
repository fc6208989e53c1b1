"""Stage 5, explain: the reasons of a decision, in the order of their weight."""

from models.assessment.decide import is_site_changed
from models.assessment.reasons import reason_of_chart, reason_of_drift, reason_of_slow_drift
from models.assessment.values import AssessmentLimits, AssessmentState, Decision, Observed
from models.geometry.pose import PLANE_PARAMETERS
from models.monitoring.chart import ChartResult
from models.monitoring.slow_drift import SlowDrift
from models.pose.estimating import PoseFinding
from models.reasons import Reason, TracksCode


def explain(
    observed: Observed,
    found: PoseFinding,
    chart: ChartResult | None,
    slow_drift: SlowDrift | None,
    decision: Decision,
    *,
    state: AssessmentState,
    limits: AssessmentLimits,
    by_factors: tuple[Reason, ...] = (),
) -> tuple[Reason, ...]:
    """Give the reasons of a decision. `by_factors` come from the factors that count."""
    fused, verdict = found.fused, decision.verdict
    otherwise = is_site_changed(found.posterior, fused) and not verdict.drifting
    # An alarm about times has the chart's reason, which comes below.
    charted = decision.cause is not None and decision.cause.code == TracksCode.CHART
    cause = None if charted else decision.cause
    plane = set(PLANE_PARAMETERS) <= set(found.drift.identifiable)
    reasons = (
        Reason(code=TracksCode.SITE_CHANGED) if otherwise else None,
        fused.reason if fused.paths_changed else None,
        None if slow_drift is None else reason_of_slow_drift(slow_drift),
        None
        if cause is not None and verdict.excess < 1
        else reason_of_drift(found.drift, verdict, limits.drift),
        *by_factors,
        cause,
        None if chart is None else reason_of_chart(chart),
        None if fused.paths_changed else fused.reason,
        None if plane else found.joint.reason,
        *state.doubts,
        observed.pieces,
    )
    return tuple(reason for reason in reasons if reason is not None)
