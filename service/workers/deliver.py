"""The delivery job of a webhook: what is due is sent, no transaction open while it is."""

import logging
import time

from service.notifications.deliveries import (
    begin_run,
    end_run,
    load_attempt,
    load_refresh,
    save_attempt,
    save_refresh,
)
from service.notifications.messages import Message
from service.notifications.send import Outcome, post
from service.workers.context import JobContext

log = logging.getLogger("surefoot.jobs")

_LONGEST_RUN_S = 60.0


def run_deliver(context: JobContext, webhook_id: str) -> None:
    """Send what a webhook is due, in order; it ends where nothing is due or the webhook rests.

    A worker that dies between a request and its record sends again under the same `webhook-id`:
    receivers know by it what they have seen.
    """
    store, settings = context.store, context.settings
    about = f"webhook/{webhook_id}"
    end_s = time.monotonic() + _LONGEST_RUN_S
    with store.write(about) as session:
        begin_run(session, webhook_id)
    while time.monotonic() < end_s and not context.stopping.is_set():
        with store.read() as session:
            attempt = load_attempt(session, settings, webhook_id)
        if attempt is None:
            break
        outcome = _send(context, webhook_id, attempt.message)
        with store.write(about) as session:
            save_attempt(session, settings, attempt, outcome)
    with store.read() as session:
        refresh = load_refresh(session, settings, webhook_id)
    if refresh is not None:
        outcome = _send(context, webhook_id, refresh)
        with store.write(about) as session:
            save_refresh(session, settings, webhook_id, refresh, outcome)
    with store.write(about) as session:
        end_run(session, context.queue, webhook_id)


def _send(context: JobContext, webhook_id: str, message: Message) -> Outcome:
    outcome = post(message.url, message.headers, message.body, context.settings.webhook_networks)
    if not outcome.ok:
        fields = {"webhook_id": webhook_id, "error": outcome.error}
        log.warning("delivery_failed", extra=fields)
    return outcome
