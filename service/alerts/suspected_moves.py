"""The times in which alerts took a camera for moved, and what came of them."""

from dataclasses import dataclass
from datetime import datetime

from sqlalchemy.orm import Session

from models.durations import DAY_S
from service.enums import Outcome
from service.settings import Settings
from service.store import alerts
from service.store.alerts import AlertRecord
from service.store.references import SiteReferenceRecord

_SAME_S = 1e-3  # times in the store are whole microseconds


@dataclass(frozen=True, slots=True, kw_only=True)
class SuspectedMove:
    """A time, from `from_s` to `to_s`, in which an alert took a camera for moved.

    It is `excluded` from what is known to be still unless a person called it a false alarm;
    `by_person` says whether anybody said what it was.
    """

    from_s: float
    to_s: float
    resolved_at: datetime
    excluded: bool
    by_person: bool


def suspected_moves(
    session: Session, settings: Settings, reference: SiteReferenceRecord
) -> tuple[SuspectedMove, ...]:
    """The ended ones of a camera that reach beyond the period of a reference."""
    found = [_move_of(record, settings) for record in alerts.ended(session, reference.camera_id)]
    return tuple(move for move in found if move and _concerns(move, reference))


def _move_of(record: AlertRecord, settings: Settings) -> SuspectedMove | None:
    if record.resolved_at is None:
        return None
    if record.changed_at is not None:
        from_s = record.changed_at.timestamp() - _SAME_S
    else:  # it was fired by a window of tracks
        from_s = record.opened_at.timestamp() - settings.window_days * DAY_S
    return SuspectedMove(
        from_s=from_s,
        to_s=record.resolved_at.timestamp(),
        resolved_at=record.resolved_at,
        excluded=record.outcome != Outcome.FALSE_ALARM,
        by_person=record.outcome in (Outcome.PUT_BACK, Outcome.FALSE_ALARM),
    )


def _concerns(move: SuspectedMove, reference: SiteReferenceRecord) -> bool:
    if move.to_s <= (reference.to_s or 0.0):
        return False
    # A reset or a new prior pose has answered it, for whatever comes after; tracks may be posted
    # long after they were walked, so that their times alone do not show it.
    answered = move.resolved_at <= reference.created_at
    return not (answered and move.from_s < (reference.from_s or 0.0))
