"""When a camera is known to have stood still: by its reference, and by what came of its alerts."""

from dataclasses import dataclass
from datetime import datetime

from sqlalchemy.orm import Session

from service.enums import Outcome
from service.settings import Settings
from service.store import alerts
from service.store.alerts import AlertRecord
from service.store.references import SiteReferenceRecord
from service.store.windows import StillBounds
from service.windows.attendance import Attendance

_DAY_S = 86_400.0
_SAME_S = 1e-3  # times in the store are whole microseconds


@dataclass(frozen=True, slots=True, kw_only=True)
class Doubt:
    """A time, from `from_s` to `to_s`, in which an alert took a camera for moved.

    It is `excluded` from what is known to be still unless a person called it a false alarm;
    `by_person` says whether anybody said what it was.
    """

    from_s: float
    to_s: float
    resolved_at: datetime
    excluded: bool
    by_person: bool


def doubts(
    session: Session, settings: Settings, reference: SiteReferenceRecord
) -> tuple[Doubt, ...]:
    """The ended doubts about a camera that reach beyond the period of a reference."""
    found = (_doubt_of(record, settings) for record in alerts.ended(session, reference.camera_id))
    return tuple(doubt for doubt in found if doubt and _concerns(doubt, reference))


def _concerns(doubt: Doubt, reference: SiteReferenceRecord) -> bool:
    if doubt.to_s <= (reference.to_s or 0.0):
        return False
    # A reset or a new prior pose has answered it, for whatever comes after; tracks may be posted
    # long after they were walked, so that their times alone do not show it.
    settled = doubt.resolved_at <= reference.created_at
    return not (settled and doubt.from_s < (reference.from_s or 0.0))


def still_bounds(
    settings: Settings,
    reference: SiteReferenceRecord,
    past: tuple[Doubt, ...],
    attended: Attendance,
    judged_from_s: float | None,
) -> StillBounds:
    """The tracks of a time in which a camera is known to have been still, and left alone.

    Of a move that nobody has noticed yet, the newest tracks may be; and those from `judged_from_s`
    on are judged by what is learned of others.
    """
    assert reference.to_s is not None
    return StillBounds(
        camera_id=reference.camera_id,
        started_from_s=reference.from_s,
        reference_to_s=reference.to_s,
        later_before_s=judged_from_s,
        unsure=settings.flow_unsure_tracks,
        without=tuple((doubt.from_s, doubt.to_s) for doubt in past if doubt.excluded),
        attended=attended.spans,
    )


def _doubt_of(record: AlertRecord, settings: Settings) -> Doubt | None:
    if record.resolved_at is None:
        return None
    # An alert that does not know when the camera moved was fired by a window of tracks.
    from_s = record.opened_at.timestamp() - settings.window_days * _DAY_S
    if record.changed_at is not None:
        from_s = record.changed_at.timestamp() - _SAME_S
    return Doubt(
        from_s=from_s,
        to_s=record.resolved_at.timestamp(),
        resolved_at=record.resolved_at,
        excluded=record.outcome != Outcome.FALSE_ALARM,
        by_person=record.outcome in (Outcome.PUT_BACK, Outcome.FALSE_ALARM),
    )
