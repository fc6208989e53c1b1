"""Tell once more of alerts that nobody has taken up for long."""

from datetime import UTC, datetime, timedelta

from sqlalchemy.orm import Session

from service.alerts.alerts import note_on_alert
from service.enums import AlertActivity
from service.settings import Settings
from service.store import alerts


def escalate(session: Session, settings: Settings) -> None:
    """Escalate alerts that nobody has acknowledged, silenced or answered, each once.

    One whose silence ended, or that was opened again, waits as long from then on.
    """
    if settings.escalate_after_min is None:
        return
    now = datetime.now(UTC)
    since = now - timedelta(minutes=settings.escalate_after_min)
    for record in alerts.unheeded(session, since, now):
        record.escalated_at = now
        note_on_alert(session, record, AlertActivity.ESCALATED, None)
