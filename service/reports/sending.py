"""When a report is due, and that each is told once: late rather than never."""

import secrets
from datetime import UTC, datetime, timedelta
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from sqlalchemy.orm import Session

from service.enums import MessageType, WebhookFormat
from service.notifications.outbox import add_delivery
from service.reports.weekly import WEEK, Report, report_body
from service.setting_values import WEEKDAYS
from service.settings import Settings
from service.store import reports, webhooks
from service.store.reports import ReportRecord
from service.wording.times import Clock

_LONGEST = 5 * WEEK  # of what was missed, that the next report tells of, too
_MAIL = Environment(
    loader=FileSystemLoader(Path(__file__).parent),
    trim_blocks=True,
    lstrip_blocks=True,
    undefined=StrictUndefined,
)


def due_at(settings: Settings, now: datetime) -> datetime | None:
    """The last time at which a report was due; None where none is wanted."""
    if settings.report_day is None:
        return None
    local = now.astimezone(settings.zone)
    days = (local.weekday() - WEEKDAYS.index(settings.report_day)) % 7
    due = (local - timedelta(days=days)).replace(
        hour=settings.report_hour, minute=0, second=0, microsecond=0, fold=0
    )
    passed = due.astimezone(UTC) <= now
    return (due if passed else due - WEEK).astimezone(UTC)


def next_period(
    session: Session, settings: Settings, now: datetime
) -> tuple[datetime, datetime] | None:
    """The times between which a report is to be made now; None where it was, or none is due.

    It begins where the last one ended. The first comes at once, of the week before it was due.
    """
    due = due_at(settings, now)
    last = reports.newest(session, now)
    if due is None or (last is not None and last.due_at >= due):
        return None
    if last is None or due - last.due_at > _LONGEST:
        return (due.astimezone(settings.zone) - WEEK).astimezone(UTC), due
    return last.due_at, due


def save_report(session: Session, settings: Settings, report: Report) -> None:
    """Keep a report to be mailed, and tell webhooks of it that take alerts of all kinds."""
    if next_period(session, settings, report.made_at) is None:
        return  # another worker has made it meanwhile
    subject, _, text = mail_text(report, settings).partition("\n")
    record = ReportRecord(
        id=secrets.token_hex(16),
        due_at=report.to,
        made_at=report.made_at,
        subject=subject,
        text=text.lstrip(),
        mailed_at=None,
        error=None,
    )
    reports.replace(session, record)
    body = report_body(report)
    for webhook in webhooks.enabled(session):
        if webhook.kinds is None and webhook.format == WebhookFormat.WEBHOOK:
            add_delivery(session, webhook, MessageType.REPORT, body, report.made_at)


def unmailed(session: Session, settings: Settings) -> ReportRecord | None:
    """The last report, where it waits to be mailed."""
    last = reports.newest(session, datetime.now(UTC)) if settings.smtp_host else None
    return last if last is not None and last.mailed_at is None else None


def note_mailed(session: Session, report_id: str, error: str | None, *, taken: bool) -> None:
    """Write down that the mail server took a report, or why it did not take it, or all of it."""
    record = session.get(ReportRecord, report_id)
    if record is not None:  # else another was made meanwhile
        record.error = error
        record.mailed_at = datetime.now(UTC) if taken else None


def mail_text(report: Report, settings: Settings) -> str:
    """A report as a mail: the subject in its first line."""
    clock = Clock(now=report.made_at, zone=settings.zone)
    url = settings.public_url and settings.public_url.rstrip("/")
    return _MAIL.get_template("mail.txt").render(report=report, clock=clock, url=url)
