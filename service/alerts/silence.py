"""Silence an open alert for a while: it stays open and shown, but nobody is to be woken by it."""

from datetime import UTC, datetime, timedelta

from sqlalchemy.orm import Session

from service.alerts.alerts import note_on_alert, require_firing
from service.enums import AlertActivity
from service.errors import FieldError, MalformedError
from service.settings import Settings
from service.store import alerts
from service.store.alerts import AlertRecord


def silence_alert(
    session: Session,
    settings: Settings,
    alert_id: str,
    until: datetime | None,
    reason: str | None,
    by: str | None,
) -> AlertRecord:
    """Silence an alert until a time, instead of whatever silence it has; None ends that.

    It holds until its time, whatever becomes of the alert meanwhile: one that grows is told of as
    silenced.

    Raises:
        NotFoundError: there is none of that id.
        ConflictError: it is resolved.
        MalformedError: the time is over, or farther away than the settings allow.
    """
    record = require_firing(session, alert_id)
    if until is None:
        if record.silenced_until is not None:
            _lift(session, record, by, reason)
        return record
    _check(until, datetime.now(UTC), settings.silence_max_days)
    record.silenced_until = until
    record.silence_reason, record.silenced_by = reason, by or "someone"
    note_on_alert(
        session, record, AlertActivity.SILENCED, record.silenced_by, until=until, note=reason
    )
    return record


def end_silences(session: Session) -> None:
    """End silences that have come to their time; what is still open is told anew."""
    for record in alerts.silences_over(session, datetime.now(UTC)):
        _lift(session, record, None, None)


def _lift(session: Session, record: AlertRecord, by: str | None, reason: str | None) -> None:
    record.silenced_until = record.silence_reason = record.silenced_by = None
    record.escalated_at = None  # told anew, it waits for somebody anew
    note_on_alert(session, record, AlertActivity.SILENCE_ENDED, by, note=reason)


def _check(until: datetime, now: datetime, most_days: float) -> None:
    problem = None
    if until <= now:
        problem = f"a time after now, {now.isoformat()}, is needed"
    elif until > now + timedelta(days=most_days):
        problem = f"at most {most_days:g} days from now are taken"
    if problem is not None:
        text = f"{problem}, got {until.isoformat()}"
        raise MalformedError(f"until: {text}", (FieldError(pointer="/until", reason=text),))
