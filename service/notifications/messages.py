"""The requests that tell a webhook of a delivery: URL, headers, body.

An Alertmanager takes alerts as its v2 API says: `POST /api/v2/alerts`, a list of postableAlert.
Labels are an alert's identity there. They are the same for its whole life but for `severity`, by
which sites route: when that changes, the alert of the other severity is ended in the same request.
Times and numbers are annotations.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime
from operator import itemgetter
from typing import Any

from sqlalchemy.orm import Session
from standardwebhooks import Webhook

from service.enums import Severity, WebhookFormat
from service.notifications.keys import secret_of
from service.notifications.outbox import alert_body, json_time
from service.settings import Settings
from service.store import webhooks
from service.store.alerts import AlertRecord
from service.store.webhooks import DeliveryRecord, WebhookRecord
from service.wording.alerts import TEST_ENDS, alert_summary
from service.wording.zones import moved_zone_words

_ZONES = 6  # in words, those that lie most wrong


@dataclass(frozen=True, slots=True, kw_only=True)
class Message:
    """A request to make."""

    url: str
    body: str
    headers: dict[str, str] = field(default_factory=dict)


def url_of(webhook: WebhookRecord) -> str:
    """Where its messages go."""
    if webhook.format == WebhookFormat.ALERTMANAGER:
        return f"{webhook.url.rstrip('/')}/api/v2/alerts"
    return webhook.url


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
        url=url_of(webhook), body=body, headers=_signed_headers(delivery.id, now, body, secrets)
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
    return Message(url=url_of(webhook), body=_json(posted))


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


def postable_alerts(
    body: dict[str, Any], public_url: str | None, *, changed: bool, at: str = ""
) -> list[dict[str, Any]]:
    """An alert, and those to end that have its name.

    Args:
        body: as of `GET /alerts/{id}`.
        public_url: where people reach the service; makes `generatorURL`.
        changed: whether its severity may have changed, so that the other one must be ended.
        at: now, when the other one ends.
    """
    alert = _postable(body, body["severity"], public_url)
    if not changed:
        return [alert]
    others = [severity for severity in Severity if severity != body["severity"]]
    return [alert, *(_postable(ended(body, at), severity, public_url) for severity in others)]


def ended(body: dict[str, Any], at: str) -> dict[str, Any]:
    """The same alert, ended at a time if it has not before."""
    return {**body, "resolved_at": body["resolved_at"] or at}


def postable_test(payload: dict[str, Any], now: str) -> dict[str, Any]:
    """A test alert that has ended as it comes: Alertmanager takes it and pages nobody."""
    return {
        "labels": {"alertname": "SurefootTest", "severity": "none"},
        "annotations": {"summary": str(payload["data"]["text"]), "description": TEST_ENDS},
        "startsAt": payload["timestamp"],
        "endsAt": now,
    }


def alert_name(kind: str) -> str:
    """`SurefootCameraNoData` of `no_data`."""
    return "SurefootCamera" + "".join(part.capitalize() for part in kind.split("_"))


def _postable(body: dict[str, Any], severity: str, public_url: str | None) -> dict[str, Any]:
    kind, camera_id = body["kind"], body["camera_id"]
    labels = {"alertname": alert_name(kind), "kind": kind, "severity": severity}
    if camera_id is not None:
        labels["camera_id"] = camera_id
    elif body.get("track_source"):  # a group's; other labels make another tracker's another alert
        labels["track_source"] = body["track_source"]
        if body.get("poster_id"):
            labels["poster_id"] = body["poster_id"]
    annotations = {
        "summary": alert_summary(kind, camera_id, body.get("camera_ids"), body.get("track_source")),
        "description": body["reason"],
        "alert_id": body["id"],
        **{f"drift_{name}": f"{value:g}" for name, value in _numbers(body["drift"]).items()},
    }
    for name in ("acknowledged_by", "escalated_at", "outcome"):
        if body.get(name):
            annotations[name] = body[name]
    if zones := body.get("zones"):
        least = sorted(zones, key=itemgetter("overlap"))[:_ZONES]
        annotations["zones"] = "\n".join(f"{z['id']}: {moved_zone_words(z)}" for z in least)
        corrected = body["corrected_zones"]
        path = f"{(public_url or '').rstrip('/')}{corrected['path']}"
        annotations["corrected_zones"] = f"{path} {corrected['how']}"
    # The change is told by the camera's clock. An alert that ended before it began is refused.
    started = min(body["changed_at"] or body["opened_at"], body["opened_at"])
    alert = {"labels": labels, "annotations": annotations, "startsAt": started}
    if body["resolved_at"]:
        alert["endsAt"] = body["resolved_at"]
    if public_url:
        alert["generatorURL"] = f"{public_url.rstrip('/')}/alerts/{body['id']}"
    return alert


def _numbers(drift: dict[str, Any] | None) -> dict[str, float]:
    values = (drift or {}).items()
    return {
        name: value
        for name, value in values
        if isinstance(value, int | float) and not isinstance(value, bool)
    }
