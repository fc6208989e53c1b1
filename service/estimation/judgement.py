"""The judgement of a finding: has the camera moved, since when, and is it its clock or its lens.

In steps: another cause, the chart that counts, the verdict, the state, the times, the reasons.
"""

from dataclasses import dataclass
from datetime import datetime

from models.durations import DAY_S
from models.geometry.pose import PLANE_PARAMETERS
from models.monitoring.verdict import (
    LIKELY,
    Drift,
    DriftVerdict,
    charted_clock,
    clock_fault,
    judge,
    may_be_clock,
    reason_of_chart,
    reason_of_creep,
    reason_of_drift,
)
from models.pose import ChartResult, WindowState, is_site_changed, reason_of_causes, state_of
from models.reasons import Reason
from service.enums import Answer, PoseState
from service.estimation.evidence import Evidence
from service.estimation.finding import Finding
from service.reasons import Reasons, ServiceCode, some
from service.store.estimates import EstimateRecord
from service.store.references import SiteReferenceRecord
from service.wording.times import from_seconds

Times = tuple[datetime | None, datetime | None]  # between which a camera moved
_UNJUDGED = DriftVerdict(streak=0, excess=0.0, drifted=())


@dataclass(frozen=True, slots=True, kw_only=True)
class History:
    """Earlier findings of a camera.

    `last` is the newest estimate against its reference, `drifted` what had drifted as long as an
    alert says so; `unsure`, as long as an alert says that nobody walks on the paths.
    """

    last: EstimateRecord | None
    drifted: tuple[str, ...]
    unsure: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement:
    """A camera's state by a finding, and `since` when, where it has moved.

    `after` is when it last stood where it should, as far as is known. `cause` is why its clock or
    its lens looks wrong, instead of its pose.
    """

    state: PoseState
    reasons: Reasons
    verdict: DriftVerdict = _UNJUDGED
    after: datetime | None = None
    since: datetime | None = None
    cause: Reason | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A finding, and all that it is judged by."""

    reference: SiteReferenceRecord
    history: History
    evidence: Evidence
    finding: Finding
    drift: Drift
    frame_rate_hz: float | None

    def judged(self) -> Judgement:
        """The judgement."""
        finding, turned = self.finding, self.finding.posterior.turned
        cause = wrong = reason_of_causes(
            finding.causes,
            finding.posterior.moved,
            self.evidence.limits.certainty,
            self.frame_rate_hz,
            self.history.drifted,
        )
        if finding.causes is None:
            cause = clock_fault(self.drift, turned, self.evidence.prior, self.frame_rate_hz)
        chart = self._counting_chart(cause)
        verdict = judge(
            self.drift,
            self.evidence.limits,
            self.history.drifted,
            chart,
            finding.creep,
            enough=finding.enough or finding.posterior.pictured,
            scaled=wrong is not None,
        )
        state = self._state(verdict)
        after, since = self._moved_between(verdict, state)
        reasons = self._reasons(verdict, cause)
        if cause is None and chart is not None and verdict.alarmed:
            cause = charted_clock(chart, turned)
        return Judgement(
            state=state, reasons=reasons, verdict=verdict, after=after, since=since, cause=cause
        )

    def _counting_chart(self, cause: Reason | None) -> ChartResult | None:
        """The drift chart's result, unless it is explained without a move."""
        chart = self.finding.reading
        if chart is None:
            return None
        if cause is None and not self.history.drifted and may_be_clock(chart):
            return None
        if self.finding.posterior.pictured and self.drift.move.moved < LIKELY:
            return None  # people walk otherwise, before a camera that stands
        return chart

    def _state(self, verdict: DriftVerdict) -> PoseState:
        """The state of the camera.

        Of fewer people than `enough`, nothing is said against what somebody said. That people walk
        on none of the paths is so until some are found to walk there again.
        """
        finding, mapped = self.finding, self.evidence.flow is not None
        posterior, fused = finding.posterior, finding.fused
        found = state_of(posterior, fused, drifting=verdict.drifting, mapped=mapped)
        # People walk elsewhere before a camera that stands: the reasons say so.
        state = PoseState.OK if found is WindowState.SITE_CHANGED else PoseState(found)
        if posterior.pictured:
            return state
        fits = finding.enough and (fused.registered or not mapped)
        if self.history.unsure and not fits and state != PoseState.DRIFTING:
            return PoseState.UNSURE
        if finding.enough or state in (PoseState.DRIFTING, PoseState.OK):
            return state
        return PoseState.OK if self.reference.answer == Answer.FALSE_ALARM else PoseState.LEARNING

    def _moved_between(self, verdict: DriftVerdict, state: PoseState) -> Times:
        """The times between which the camera moved, or may have; None each if not known.

        Fewer than 12 people after the move do not determine when it was: until there are more,
        there is no time.
        """
        last, reference, between = self.history.last, self.reference, self.finding.between
        told = (None, None) if last is None else (last.drift_after, last.drift_since)
        if verdict.streak <= 0 and state != PoseState.SUSPECTED:
            return told if verdict.drifting else (None, None)
        if reference.changed_s is not None and reference.changed_after_s is not None:
            return _between(reference.changed_after_s, reference.changed_s)
        if between is not None and (between.first or told[1] is None):
            after_s, before_s = self.evidence.times_of(between)
            # In its position as it was learned; or at a person's answer, with which a window begins
            # that no change has begun.
            answered_s = reference.window_from_s if reference.changed_s is None else None
            stood_s = max(reference.to_s or 0.0, answered_s or 0.0)
            return _between(stood_s if after_s is None else after_s, before_s)
        creep = self.finding.creep
        if told[1] is None and creep is not None and creep.moved:
            return None, from_seconds(creep.since_day * DAY_S)
        return told

    def _reasons(self, verdict: DriftVerdict, cause: Reason | None) -> Reasons:
        """The reasons, those that matter most first."""
        finding, fused = self.finding, self.finding.fused
        otherwise = is_site_changed(finding.posterior, fused) and not verdict.drifting
        plane = set(PLANE_PARAMETERS) <= set(self.drift.identifiable)
        return some(
            Reason(code=ServiceCode.SITE_CHANGED) if otherwise else None,
            fused.reason if fused.paths_changed else None,
            None if finding.creep is None else reason_of_creep(finding.creep),
            None
            if cause is not None and verdict.excess < 1
            else reason_of_drift(self.drift, verdict, self.evidence.limits),
            finding.picture.reason if finding.picture and finding.posterior.pictured else None,
            cause,
            None if finding.reading is None else reason_of_chart(finding.reading),
            None if fused.paths_changed else fused.reason,
            None if plane else finding.joint.reason,
            *self.reference.doubts,
            finding.pieces,
            *finding.failures,
        )


def _between(after_s: float, before_s: float) -> Times:
    """The times of a move; tracks overlap, so that either may be the earlier one."""
    return from_seconds(min(after_s, before_s)), from_seconds(max(after_s, before_s))
