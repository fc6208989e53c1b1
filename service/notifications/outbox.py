"""The outbox: what webhooks are to be told, written with the change that it tells of.

A delivery is a row of the transaction that changed the alert, and so is the job that sends it: a
change that is rolled back tells nobody, one that is committed is told however often the process
dies.
"""

import secrets
from datetime import UTC, datetime, timedelta
from typing import Any

from sqlalchemy.orm import Session

from service.degrees import in_degrees
from service.enums import DeliveryState, MessageType
from service.job_queue import JobQueue, queue_of
from service.store import webhooks
from service.store.alerts import AlertRecord, told_by
from service.store.webhooks import DeliveryRecord, WebhookRecord
from service.wording.reasons import in_words
from service.wording.zones import apply_words

_ALERT_FIELDS = (
    *("id", "camera_id", "kind", "state", "severity", "reason", "reason_code", "reason_values"),
    *(
        "drift",
        "opened_at",
        "changed_after",
        "changed_at",
        "updated_at",
        "acknowledged_by",
        "acknowledged_at",
        "escalated_at",
    ),
    *("silenced_until", "silence_reason", "silenced_by", "resolved_at", "resolved_by"),
    *("outcome", "note", "track_source", "poster_id", "camera_ids", "group_id"),
)
# A silenced alert is quiet but for these.
_TOLD_IN_SILENCE = (MessageType.ALERT_SILENCED, MessageType.ALERT_RESOLVED)
_JOB_LOST = timedelta(seconds=30)


def queue_alert(
    session: Session, record: AlertRecord, body: dict[str, Any], message: MessageType
) -> None:
    """Tell the webhooks that want it of a change to an alert, with its body as of now."""
    now = datetime.now(UTC)
    if record.is_silenced(now) and message not in _TOLD_IN_SILENCE:
        return
    for webhook in webhooks.enabled(session):
        if webhook.kinds is None or not told_by(record.kind).isdisjoint(webhook.kinds):
            add_delivery(session, webhook, message, body, now, alert_id=record.id)


def add_delivery(
    session: Session,
    webhook: WebhookRecord,
    type_: MessageType,
    data: dict[str, Any],
    now: datetime,
    *,
    alert_id: str | None = None,
) -> DeliveryRecord:
    """Write a message for a webhook, and have it sent."""
    record = DeliveryRecord(
        id=secrets.token_hex(16),
        webhook_id=webhook.id,
        alert_id=alert_id,
        type=type_,
        payload={"type": type_, "timestamp": json_time(now), "data": data},
        state=DeliveryState.PENDING,
        attempts=0,
        tries=0,
        next_attempt_at=now,
        queued_at=now,
        created_at=now,
    )
    session.add(record)
    wake(session, queue_of(session), webhook, now)
    return record


def wake(session: Session, queue: JobQueue, webhook: WebhookRecord, now: datetime) -> None:
    """Queue a delivery job of a webhook, unless one waits to start that covers this."""
    queued_at = webhook.job_queued_at
    # Either way: a clock that was set back must not keep messages waiting for it.
    if webhook.enabled and (queued_at is None or abs(now - queued_at) > _JOB_LOST):
        webhook.job_queued_at = now
        queue.enqueue_deliver(session, webhook.id)


def alert_body(record: AlertRecord) -> dict[str, Any]:
    """An alert as clients see it, in the API, in webhooks and, in part, in events."""
    made = {"reason": in_words(record.reasons), "drift": in_degrees(record.drift)}
    values = {name: made[name] if name in made else getattr(record, name) for name in _ALERT_FIELDS}
    body = {
        name: json_time(value) if isinstance(value, datetime) else value
        for name, value in values.items()
    }
    moved = (record.evidence or {}).get("zones") or {}
    body["zones"] = moved.get("zones")
    body["corrected_zones"] = corrected_zones(record.camera_id, moved["form"]) if moved else None
    body["since"] = {"after": body.pop("changed_after"), "before": body["changed_at"]}
    body["acknowledged"] = record.acknowledged_at is not None
    body["silenced"] = record.is_silenced(datetime.now(UTC))
    return body


def corrected_zones(camera_id: str | None, form: str | None) -> dict[str, Any]:
    """Where zones are as they should lie now, in the form that they came in, and what to do."""
    path = f"/cameras/{camera_id}/zones" + (f"?format={form}" if form else "")
    return {"path": path, "format": form, "how": apply_words(form)}


def json_time(at: datetime) -> str:
    """A time as JSON has it."""
    return at.astimezone(UTC).isoformat().replace("+00:00", "Z")
