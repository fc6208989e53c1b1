"""The weekly report: made when it is due, or as soon as a worker runs, and mailed once."""

import logging
import time
from datetime import UTC, datetime

from service.notifications.mail import send_mail
from service.reports import sending
from service.reports.weekly import make_report
from service.workers.context import JobContext

log = logging.getLogger("surefoot.jobs")


class ReportRounds:
    """Makes and mails; a mail server that fails is tried again as webhooks are."""

    def __init__(self) -> None:
        self._tries = 0
        self._again_s = 0.0

    def run(self, context: JobContext) -> None:
        """Make the report, if one is due, and mail it, if it is not yet.

        A worker that dies between the server's answer and its record mails it again, under the same
        `Message-ID`.
        """
        _make(context)
        if time.monotonic() >= self._again_s:
            self._mail(context)

    def _mail(self, context: JobContext) -> None:
        settings = context.settings
        with context.store.read() as session:
            record = sending.unmailed(session, settings)
        if record is None:
            return
        taken = True
        try:
            error = send_mail(settings, record.subject, record.text, record.id, record.made_at)
            self._tries = 0
        except OSError as failed:  # smtplib's errors are such, too
            error, taken = str(failed)[:500] or type(failed).__name__, False
            delays_s = settings.webhook_delays_s
            self._again_s = time.monotonic() + delays_s[min(self._tries, len(delays_s) - 1)]
            self._tries += 1
        if error is not None:
            log.warning("report_not_taken", extra={"error": error})
        with context.store.write("reports/") as session:
            sending.note_mailed(session, record.id, error, taken=taken)


def _make(context: JobContext) -> None:
    with context.store.read() as session:
        period = sending.next_period(session, context.settings, datetime.now(UTC))
        if period is None:
            return
        report = make_report(session, context.settings, *period)
    with context.store.write("reports/") as session:
        sending.save_report(session, context.settings, report)
    log.info("report_made", extra={"due_at": period[1].isoformat()})
