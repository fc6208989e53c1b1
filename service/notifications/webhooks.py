"""Create, change, test and remove webhooks; look at what was delivered, and replay it."""

import secrets
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

from sqlalchemy.orm import Session

from models.reasons import Reason
from service.access.activity import note
from service.enums import Activity, AlertKind, DeliveryState, MessageType, WebhookFormat
from service.errors import ConflictError, FieldError, MalformedError, NotFoundError
from service.job_queue import JobQueue
from service.notifications.keys import new_secret, sealed_secret
from service.notifications.outbox import add_delivery, wake
from service.notifications.send import AddressError, check_url
from service.reasons import ServiceCode
from service.settings import Settings
from service.store import webhooks
from service.store.webhooks import Backlog, DeliveryRecord, WebhookRecord
from service.wording.reasons import in_words

OLD_SECRET_STAYS = timedelta(hours=24)
_BY_A_PERSON = Reason(code=ServiceCode.DISABLED_BY_PERSON)


@dataclass(frozen=True, slots=True, kw_only=True)
class WebhookSpec:
    """A webhook as an integrator wants it; its URL was checked. No kinds: all."""

    url: str
    name: str
    kinds: Sequence[AlertKind] | None
    format: WebhookFormat
    enabled: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class WebhookView:
    """A webhook as clients see it; never with its secret."""

    record: WebhookRecord
    pending: int


@dataclass(frozen=True, slots=True, kw_only=True)
class SecretMade:
    """A webhook and its new secret in plain text; an Alertmanager has none."""

    record: WebhookRecord
    secret: str | None


def require_url(settings: Settings, url: str) -> None:
    """Check where a URL leads. Asks the resolver, so no transaction may be open.

    Raises:
        MalformedError: nothing may be sent there.
    """
    try:
        check_url(url, settings.webhook_networks)
    except AddressError as error:
        field = FieldError(pointer="/url", reason=str(error))
        raise MalformedError(f"url: {error}", (field,)) from error


def create_webhook(session: Session, settings: Settings, spec: WebhookSpec) -> SecretMade:
    """Store a webhook; its secret is shown this once."""
    now = datetime.now(UTC)
    webhook_id = secrets.token_hex(16)
    secret = new_secret() if spec.format == WebhookFormat.WEBHOOK else None
    record = WebhookRecord(
        id=webhook_id,
        name=spec.name,
        url=spec.url,
        format=spec.format,
        kinds=None if spec.kinds is None else list(spec.kinds),
        enabled=spec.enabled,
        disabled_reasons=() if spec.enabled else (_BY_A_PERSON,),
        secret=None if secret is None else sealed_secret(settings, webhook_id, secret),
        created_at=now,
        updated_at=now,
    )
    session.add(record)
    session.flush()
    _note(session, Activity.WEBHOOK_ADDED, record)
    return SecretMade(record=record, secret=secret)


def list_webhooks(session: Session) -> Sequence[WebhookView]:
    """All webhooks, oldest first."""
    backlogs = webhooks.backlogs(session)
    return [_view(record, backlogs) for record in webhooks.every(session)]


def show_webhook(session: Session, webhook_id: str) -> WebhookView:
    """A webhook.

    Raises:
        NotFoundError: there is none of that id.
    """
    return _view(_require(session, webhook_id), webhooks.backlogs(session))


def change_webhook(
    session: Session, queue: JobQueue, webhook_id: str, changes: dict[str, Any]
) -> WebhookView:
    """Change the name, URL, kinds or whether it is enabled; then what waits is tried at once.

    Raises:
        NotFoundError: there is none of that id.
    """
    record = _require(session, webhook_id)
    now = datetime.now(UTC)
    for name, value in changes.items():
        setattr(record, name, value)
    record.updated_at = now
    _note(session, Activity.WEBHOOK_CHANGED, record, sorted(changes))
    if changes.get("enabled") is False:
        record.disable(_BY_A_PERSON)
    elif changes.get("enabled") or "url" in changes:
        if record.enabled:
            record.disabled_reasons = ()
        record.held_until = record.failing_since = record.last_error = None
        webhooks.bring_forward(session, webhook_id, now, refused=())
        wake(session, queue, record, now)
    session.flush()
    return show_webhook(session, webhook_id)


def rotate_secret(session: Session, settings: Settings, webhook_id: str) -> SecretMade:
    """Give a webhook a new secret; for a day, messages are signed with the old one, too.

    Raises:
        NotFoundError: there is none of that id.
        ConflictError: it has none.
    """
    record = _require(session, webhook_id)
    if record.secret is None:
        raise ConflictError(f"format: only webhooks have secrets, this is {record.format}")
    now = datetime.now(UTC)
    record.old_secret, record.old_secret_until = record.secret, now + OLD_SECRET_STAYS
    secret = new_secret()
    record.secret, record.updated_at = sealed_secret(settings, webhook_id, secret), now
    _note(session, Activity.WEBHOOK_SECRET_CHANGED, record)
    return SecretMade(record=record, secret=secret)


def remove_webhook(session: Session, webhook_id: str) -> None:
    """Delete a webhook with its deliveries.

    Raises:
        NotFoundError: there is none of that id.
    """
    record = _require(session, webhook_id)
    _note(session, Activity.WEBHOOK_REMOVED, record)
    session.delete(record)


def test_webhook(session: Session, webhook_id: str) -> DeliveryRecord:
    """Queue a message of the type `test`.

    Raises:
        NotFoundError: there is none of that id.
        ConflictError: it is disabled.
    """
    record = _require_enabled(session, webhook_id)
    data = {"webhook_id": record.id, "name": record.name, "text": "This is a test of surefoot."}
    record.held_until = None
    delivery = add_delivery(session, record, MessageType.TEST, data, datetime.now(UTC))
    _note(session, Activity.WEBHOOK_TESTED, record)
    session.flush()
    return delivery


def list_deliveries(
    session: Session, webhook_id: str, state: DeliveryState | None, limit: int
) -> Sequence[DeliveryRecord]:
    """A webhook's deliveries, newest first.

    Raises:
        NotFoundError: there is no such webhook.
    """
    _require(session, webhook_id)
    return webhooks.log(session, webhook_id, state, limit)


def show_delivery(session: Session, delivery_id: str) -> DeliveryRecord:
    """A delivery with its attempts.

    Raises:
        NotFoundError: there is none of that id.
    """
    record = webhooks.find_delivery(session, delivery_id)
    if record is None:
        raise NotFoundError(f"delivery_id: there is no delivery {delivery_id!r}")
    return record


def replay_delivery(session: Session, queue: JobQueue, delivery_id: str) -> DeliveryRecord:
    """Send a delivery anew and at once, under its id; if that fails, its retries begin anew.

    Raises:
        NotFoundError: there is none of that id.
        ConflictError: its webhook is disabled.
    """
    record = show_delivery(session, delivery_id)
    webhook = _require_enabled(session, record.webhook_id)
    now = datetime.now(UTC)
    record.state, record.tries, record.finished_at = DeliveryState.PENDING, 0, None
    record.next_attempt_at = record.queued_at = now
    webhook.held_until = None
    _note(session, Activity.WEBHOOK_REPLAYED, webhook)
    wake(session, queue, webhook, now)
    return record


def _note(
    session: Session, what: Activity, record: WebhookRecord, fields: Sequence[str] = ()
) -> None:
    """Keep what was done with a webhook; its URL may be a secret, so its name says which."""
    details = {"name": record.name, **({"fields": list(fields)} if fields else {})}
    note(session, what, by=None, subject_id=record.id, details=details)


def _view(record: WebhookRecord, backlogs: dict[str, Backlog]) -> WebhookView:
    backlog = backlogs.get(record.id)
    return WebhookView(record=record, pending=0 if backlog is None else backlog.count)


def _require(session: Session, webhook_id: str) -> WebhookRecord:
    record = session.get(WebhookRecord, webhook_id)
    if record is None:
        raise NotFoundError(f"webhook_id: there is no webhook {webhook_id!r}")
    return record


def _require_enabled(session: Session, webhook_id: str) -> WebhookRecord:
    record = _require(session, webhook_id)
    if not record.enabled:
        why = in_words(record.disabled_reasons)
        raise ConflictError(f"enabled: this webhook is disabled: {why}")
    return record
