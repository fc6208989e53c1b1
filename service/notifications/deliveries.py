"""The messages of a delivery job, and what comes of them: delivered, tried again, given up."""

import random
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from sqlalchemy.orm import Session

from models.durations import HOUR_S
from models.reasons import Reason, Value
from service.enums import DeliveryState, WebhookFormat
from service.job_queue import JobQueue
from service.notifications.messages import Message, all_firing, message_of, url_of
from service.notifications.outbox import wake
from service.notifications.send import Outcome
from service.reasons import ServiceCode
from service.settings import Settings
from service.store import webhooks
from service.store.webhooks import DeliveryAttemptRecord, DeliveryRecord, WebhookRecord

GONE = 410
# A receiver that answers so means this message, not itself: others need not wait for it.
REFUSED = (400, 413, 422)
_JITTER = 0.2
_LONGEST_HOLD_S = 60.0
_LONGEST_RETRY_AFTER_S = 6 * HOUR_S


@dataclass(frozen=True, slots=True, kw_only=True)
class Attempt:
    """A delivery whose time has come. `due_at` tells later whether it was replayed meanwhile."""

    number: int
    webhook_id: str
    due_at: datetime
    message: Message


def begin_run(session: Session, webhook_id: str) -> None:
    """Take the mark "a job waits" off a webhook: what is queued from now on queues its own."""
    webhook = session.get(WebhookRecord, webhook_id)
    if webhook is not None:
        webhook.job_queued_at = None


def load_attempt(session: Session, settings: Settings, webhook_id: str) -> Attempt | None:
    """The next message to a webhook, if it is due."""
    now = datetime.now(UTC)
    webhook = session.get(WebhookRecord, webhook_id)
    if webhook is None or not _is_open(webhook, now):
        return None
    delivery = webhooks.next_due(session, webhook_id, now)
    if delivery is None:
        return None
    assert delivery.next_attempt_at is not None
    return Attempt(
        number=delivery.number,
        webhook_id=webhook_id,
        due_at=delivery.next_attempt_at,
        message=message_of(session, settings, webhook, delivery, now),
    )


def save_attempt(session: Session, settings: Settings, attempt: Attempt, outcome: Outcome) -> None:
    """Write down what came of an attempt, and when the next one is."""
    delivery = session.get(DeliveryRecord, attempt.number)
    webhook = session.get(WebhookRecord, attempt.webhook_id)
    if delivery is None or webhook is None:
        return  # deleted while it was sent
    session.add(
        DeliveryAttemptRecord(
            delivery_number=delivery.number,
            started_at=outcome.started_at,
            duration_s=outcome.duration_s,
            status_code=outcome.status_code,
            error=outcome.error,
        )
    )
    delivery.attempts += 1
    delivery.status_code, delivery.error = outcome.status_code, outcome.error
    now = datetime.now(UTC)
    replayed = delivery.next_attempt_at != attempt.due_at
    if outcome.ok:
        _succeeded(session, webhook, now)
        if not replayed:
            _finish(delivery, DeliveryState.DELIVERED, now)
        return
    if url_of(webhook) != attempt.message.url:
        return  # another endpoint by now, to which all that waits is sent at once
    delay_s = _delay_s(settings, delivery.tries, outcome)
    _failed(settings, webhook, outcome, delay_s, now)
    if replayed:
        return
    delivery.tries += 1
    delivery.next_attempt_at = now + timedelta(seconds=delay_s)
    patience = timedelta(hours=settings.webhook_patience_h)
    if outcome.status_code == GONE or delivery.next_attempt_at - delivery.queued_at > patience:
        _finish(delivery, DeliveryState.FAILED, now)


def load_refresh(session: Session, settings: Settings, webhook_id: str) -> Message | None:
    """All that fires, if an Alertmanager, which forgets, is to be told again now."""
    now = datetime.now(UTC)
    webhook = session.get(WebhookRecord, webhook_id)
    if webhook is None or not _is_open(webhook, now) or not _needs_refresh(settings, webhook, now):
        return None
    return all_firing(session, settings, webhook, now)


def save_refresh(
    session: Session, settings: Settings, webhook_id: str, told: Message, out: Outcome
) -> None:
    """Write down when an Alertmanager was told; it has no row of its own in the log."""
    webhook = session.get(WebhookRecord, webhook_id)
    if webhook is None or url_of(webhook) != told.url:
        return
    now = datetime.now(UTC)
    webhook.refreshed_at = now
    if out.ok:
        _succeeded(session, webhook, now)
    else:
        _failed(settings, webhook, out, _LONGEST_HOLD_S, now)


def end_run(session: Session, queue: JobQueue, webhook_id: str) -> None:
    """Queue another job where there is more to send than one may take on."""
    now = datetime.now(UTC)
    webhook = session.get(WebhookRecord, webhook_id)
    if webhook is not None and webhooks.next_due(session, webhook_id, now) is not None:
        wake(session, queue, webhook, now)


def awaited(session: Session, settings: Settings) -> list[str]:
    """The webhooks for which there is something to send now."""
    now = datetime.now(UTC)
    due = webhooks.due(session, now)
    return [
        webhook.id
        for webhook in webhooks.enabled(session)
        if _is_open(webhook, now)
        and (webhook.id in due or _has_refresh(session, settings, webhook, now))
    ]


def reconcile_webhook(session: Session, queue: JobQueue, webhook_id: str) -> None:
    """Queue a delivery job, unless one waits."""
    webhook = session.get(WebhookRecord, webhook_id)
    if webhook is not None:
        wake(session, queue, webhook, datetime.now(UTC))


def _is_open(webhook: WebhookRecord, now: datetime) -> bool:
    held = webhook.held_until is not None and webhook.held_until > now
    return webhook.enabled and not held


def _needs_refresh(settings: Settings, webhook: WebhookRecord, now: datetime) -> bool:
    if webhook.format != WebhookFormat.ALERTMANAGER:
        return False
    every = timedelta(seconds=settings.alertmanager_refresh_s)
    # Either way: one of the future was before the clock was set back.
    return webhook.refreshed_at is None or abs(now - webhook.refreshed_at) >= every


def _has_refresh(
    session: Session, settings: Settings, webhook: WebhookRecord, now: datetime
) -> bool:
    return _needs_refresh(settings, webhook, now) and bool(
        webhooks.audible(session, webhook.kinds, now)
    )


def _succeeded(session: Session, webhook: WebhookRecord, now: datetime) -> None:
    if webhook.failing_since is not None:
        webhooks.bring_forward(session, webhook.id, now, REFUSED)
    webhook.delivered_at = now
    webhook.failing_since = webhook.last_error = webhook.held_until = None


def _failed(
    settings: Settings, webhook: WebhookRecord, outcome: Outcome, delay_s: float, now: datetime
) -> None:
    """Note that an endpoint failed; it rests a moment, and is disabled if that goes on for days."""
    webhook.failing_since = webhook.failing_since or now
    webhook.last_error = outcome.error
    if outcome.status_code not in REFUSED:
        rest_s = max(min(delay_s, _LONGEST_HOLD_S), _retry_after_s(outcome))
        webhook.held_until = now + timedelta(seconds=rest_s)
    if outcome.status_code == GONE:
        webhook.disable(Reason(code=ServiceCode.ENDPOINT_GONE))
        return
    patience = timedelta(hours=settings.webhook_patience_h)
    if now - webhook.failing_since > patience:
        values: dict[str, Value] = {
            "patience_s": patience.total_seconds(),
            "error": str(outcome.error),
        }
        webhook.disable(Reason(code=ServiceCode.ENDPOINT_FAILS, values=values))


def _finish(delivery: DeliveryRecord, state: DeliveryState, now: datetime) -> None:
    delivery.state, delivery.finished_at, delivery.next_attempt_at = state, now, None


def _delay_s(settings: Settings, tries: int, outcome: Outcome) -> float:
    delays_s = settings.webhook_delays_s
    scheduled_s = delays_s[min(tries, len(delays_s) - 1)] * random.uniform(1, 1 + _JITTER)
    return max(scheduled_s, _retry_after_s(outcome))


def _retry_after_s(outcome: Outcome) -> float:
    return min(outcome.retry_after_s or 0.0, _LONGEST_RETRY_AFTER_S)
