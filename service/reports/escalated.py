"""The mail of alerts that were escalated: one of all that wait, and the log keeps that it went."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from sqlalchemy.orm import Session

from service.access.activity import note
from service.cameras.status import alert_since
from service.enums import Activity
from service.settings import Settings
from service.store import alerts, fleet
from service.store.alerts import AlertRecord
from service.wording.alerts import about_words, alert_line, done_words
from service.wording.times import Clock


@dataclass(frozen=True, slots=True, kw_only=True)
class EscalationMail:
    """A mail of some alerts; of the same ones its id is the same."""

    id: str
    subject: str
    text: str
    alerts: Sequence[AlertRecord]


def next_mail(session: Session, settings: Settings) -> EscalationMail | None:
    """The mail of what was escalated and is not mailed; None of nothing, or without a server."""
    clock = Clock(now=datetime.now(UTC), zone=settings.zone)
    found = alerts.unmailed(session, clock.now) if settings.smtp_host else ()
    if not found:
        return None
    names = dict(fleet.names(session, {a.camera_id for a in found if a.camera_id is not None}))
    lines = [
        f"- {about_words(each, names)}: {alert_line(each)}, "
        f"since {clock.dated(alert_since(each))}; {done_words(each, clock.now)}"
        for each in found
    ]
    if settings.public_url:
        lines += ["", f"{settings.public_url.rstrip('/')}/ui/alerts?acknowledged=false"]
    which = " ".join(f"{each.id} {each.escalated_at}" for each in found)
    what = "1 alert" if len(found) == 1 else f"{len(found)} alerts"
    return EscalationMail(
        id=hashlib.sha256(which.encode()).hexdigest()[:32],
        subject=f"surefoot: nobody took up {what}",
        text="\n".join([*lines, ""]),
        alerts=found,
    )


def note_mailed(session: Session, mail: EscalationMail, error: str | None) -> None:
    """Keep that a mail told of its alerts, and who was refused."""
    for each in mail.alerts:
        note(
            session,
            Activity.ALERT_MAILED,
            by=None,
            camera_id=each.camera_id,
            subject_id=each.id,
            kind=each.kind,
            text=error,
        )
