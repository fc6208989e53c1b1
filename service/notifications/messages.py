"""The requests that tell a webhook of a delivery: URL, headers, body."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from sqlalchemy.orm import Session
from standardwebhooks import Webhook

from service.enums import WebhookFormat
from service.notifications.alertmanager import ended, postable_alerts, postable_test
from service.notifications.keys import secret_of
from service.notifications.outbox import alert_body, json_time
from service.settings import Settings
from service.store import webhooks
from service.store.alerts import AlertRecord
from service.store.webhooks import DeliveryRecord, WebhookRecord


@dataclass(frozen=True, slots=True, kw_only=True)
class Message:
    """A request to make."""

    url: str
    body: str
    headers: dict[str, str] = field(default_factory=dict)


def message_of(
    session: Session,
    settings: Settings,
    webhook: WebhookRecord,
    delivery: DeliveryRecord,
    now: datetime,
) -> Message:
    """The request of a delivery: a signed one, or an Alertmanager's."""
    if webhook.format == WebhookFormat.ALERTMANAGER:
        return _to_alertmanager(webhook, _stands(session, settings, delivery, now))
    body = _json(delivery.payload)
    secrets = [secret_of(settings, webhook) or ""]
    if webhook.old_secret and webhook.old_secret_until and webhook.old_secret_until > now:
        secrets.append(secret_of(settings, webhook, old=True) or "")
    return Message(
        url=webhook.url, body=body, headers=_signed_headers(delivery.id, now, body, secrets)
    )


def all_firing(
    session: Session, settings: Settings, webhook: WebhookRecord, now: datetime
) -> Message | None:
    """The request that tells an Alertmanager of all that fires; None where nothing does."""
    firing = webhooks.audible(session, webhook.kinds, now)
    posted = [
        alert
        for record in firing
        for alert in postable_alerts(alert_body(record), settings.public_url, changed=False)
    ]
    return _to_alertmanager(webhook, posted) if posted else None


def _stands(
    session: Session, settings: Settings, delivery: DeliveryRecord, now: datetime
) -> list[dict[str, Any]]:
    """The alert of a delivery as it stands now, not as it was.

    An Alertmanager keeps states, not a story: an old message that came late would fire anew what
    has ended. What is silenced here, or gone with its camera, has ended for it.
    """
    if delivery.alert_id is None:
        return [postable_test(delivery.payload, json_time(now))]
    record = session.get(AlertRecord, delivery.alert_id)
    body = delivery.payload["data"] if record is None else alert_body(record)
    if record is None or record.is_silenced(now):
        body = ended(body, json_time(now))
    return postable_alerts(body, settings.public_url, changed=True, at=json_time(now))


def _to_alertmanager(webhook: WebhookRecord, posted: list[dict[str, Any]]) -> Message:
    return Message(url=f"{webhook.url.rstrip('/')}/api/v2/alerts", body=_json(posted))


def _signed_headers(
    message_id: str, at: datetime, body: str, signing_secrets: Sequence[str]
) -> dict[str, str]:
    """The headers of Standard Webhooks: several secrets give several signatures, for rotation."""
    signatures = [Webhook(secret).sign(message_id, at, body) for secret in signing_secrets]
    return {
        "webhook-id": message_id,
        "webhook-timestamp": str(int(at.timestamp())),
        "webhook-signature": " ".join(signatures),
    }


def _json(value: Any) -> str:
    return json.dumps(value, separators=(",", ":"), ensure_ascii=False)
