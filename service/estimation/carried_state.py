"""What an assessment takes over from earlier ones, and from the operators' answers to them."""

from datetime import datetime

from sqlalchemy.orm import Session

from models.assessment import AssessmentState, TimeSpan
from models.geometry.pose import PLANE_PARAMETERS
from service.enums import AlertKind, Answer
from service.references import made_against
from service.store import alerts, estimates
from service.store.alerts import MOVED_KINDS
from service.store.estimates import EstimateRecord
from service.store.references import SiteReferenceRecord


def last_estimate(session: Session, reference: SiteReferenceRecord) -> EstimateRecord | None:
    """The newest estimate that was made against a reference."""
    last = estimates.newest(session, reference.camera_id)
    return last if last is not None and made_against(reference, last) else None


def carried_state(session: Session, reference: SiteReferenceRecord) -> AssessmentState:
    """The state that a camera's next assessment begins with, without where its search may begin."""
    camera_id = reference.camera_id
    last = last_estimate(session, reference)
    firing = alerts.firing_by_estimates(session, camera_id)
    alerted = bool(firing & set(MOVED_KINDS))
    drifted: tuple[str, ...] = ()
    if alerted:
        # An alert from before this reference stays open until later tracks end it.
        before = last or estimates.newest_of_earlier(session, camera_id, reference.id)
        drifted = (() if before is None else tuple(before.drifted)) or PLANE_PARAMETERS
    return AssessmentState(
        drifted=drifted,
        alerted=alerted,
        unsure=AlertKind.UNSURE in firing,
        false_alarm=reference.answer == Answer.FALSE_ALARM,
        change=_change_of(reference),
        moved_at=None if last is None else _span(last.drift_after, last.drift_since),
        stationary_until_s=_stationary_until_s(reference),
        assessed_until_s=None if last is None else last.to_s,
        doubts=tuple(reference.doubts),
    )


def _stationary_until_s(reference: SiteReferenceRecord) -> float:
    """The end of the reference, or the operator's answer, if no change has begun the window."""
    answered_s = reference.window_from_s if reference.changed_s is None else None
    return max(reference.to_s or 0.0, answered_s or 0.0)


def _change_of(reference: SiteReferenceRecord) -> TimeSpan | None:
    if reference.changed_s is None:
        return None
    return TimeSpan(reference.changed_after_s, reference.changed_s)


def _span(after: datetime | None, before: datetime | None) -> TimeSpan:
    after_s, before_s = (None if at is None else at.timestamp() for at in (after, before))
    return TimeSpan(after_s, before_s)
