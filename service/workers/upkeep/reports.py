"""Mail: the weekly report, made when it is due or as soon as a worker runs, and escalations."""

import logging
import time
from datetime import UTC, datetime

from service.notifications.mail import send_mail
from service.reports import escalated, sending
from service.reports.weekly import make_report
from service.settings import Settings
from service.workers.context import JobContext

log = logging.getLogger("surefoot.jobs")


class ReportRounds:
    """Makes and mails reports, and mails of what was escalated.

    A mail server that fails is tried again as webhooks are. A worker that dies between the server's
    answer and its record mails again, under the same `Message-ID`.
    """

    def __init__(self) -> None:
        self._tries = 0
        self._again_s = 0.0

    def run(self, context: JobContext) -> None:
        """Make the report, if one is due, and mail it and what was escalated, if it is not yet."""
        _make(context)
        for mail in (self._mail_escalated, self._mail_report):
            if time.monotonic() >= self._again_s:
                mail(context)

    def _mail_report(self, context: JobContext) -> None:
        with context.store.read() as session:
            record = sending.unmailed(session, context.settings)
        if record is None:
            return
        error, taken = self._send(
            context.settings, record.subject, record.text, record.id, record.made_at
        )
        with context.store.write("reports/") as session:
            sending.note_mailed(session, record.id, error, taken=taken)

    def _mail_escalated(self, context: JobContext) -> None:
        with context.store.read() as session:
            mail = escalated.next_mail(session, context.settings)
        if mail is None:
            return
        error, taken = self._send(
            context.settings, mail.subject, mail.text, mail.id, datetime.now(UTC)
        )
        if taken:
            with context.store.write() as session:
                escalated.note_mailed(session, mail, error)

    def _send(
        self, settings: Settings, subject: str, text: str, message_id: str, made_at: datetime
    ) -> tuple[str | None, bool]:
        """Mail something; says what went wrong, and whether the server took it."""
        try:
            error = send_mail(settings, subject, text, message_id, made_at)
            self._tries, taken = 0, True
        except OSError as failed:  # smtplib's errors are such, too
            error, taken = str(failed)[:500] or type(failed).__name__, False
            delays_s = settings.webhook_delays_s
            self._again_s = time.monotonic() + delays_s[min(self._tries, len(delays_s) - 1)]
            self._tries += 1
        if error is not None:
            log.warning("mail_not_taken", extra={"error": error})
        return error, taken


def _make(context: JobContext) -> None:
    with context.store.read() as session:
        period = sending.next_period(session, context.settings, datetime.now(UTC))
        if period is None:
            return
        report = make_report(session, context.settings, *period)
    with context.store.write("reports/") as session:
        sending.save_report(session, context.settings, report)
    log.info("report_made", extra={"due_at": period[1].isoformat()})
