"""`/webhooks` and `/deliveries`: endpoints, their secrets, the log of what was sent, replay."""

from datetime import datetime
from typing import Annotated, Any, Self

from fastapi import APIRouter, Depends, Query, Response
from pydantic import BaseModel, Field, field_validator

from service.api.ignored import NamingRoute
from service.api.middleware.dependencies import ReadDep, StateDep, WriteDep
from service.api.schemas import Body, Out, ReasonCode
from service.enums import AlertKind, DeliveryState, MessageType, WebhookFormat
from service.notifications import webhooks
from service.notifications.webhooks import WebhookSpec, WebhookView
from service.reasons import code_of
from service.store.webhooks import DeliveryRecord, WebhookRecord
from service.wording.reasons import in_words

Kinds = Annotated[list[AlertKind], Field(min_length=1, max_length=10)]


class WebhookBody(Body):
    """An endpoint to deliver to; without kinds, alerts of all kinds."""

    url: str
    name: str = Field("", max_length=200)
    kinds: Kinds | None = None
    format: WebhookFormat = WebhookFormat.WEBHOOK
    enabled: bool = True


class WebhookPatch(Body):
    """What to change of a webhook; fields left out stay, kinds of null are all."""

    url: str | None = None
    name: str | None = Field(None, max_length=200)
    kinds: Kinds | None = None
    enabled: bool | None = None

    @field_validator("url", "name", "enabled")
    @classmethod
    def _given(cls, value: object) -> object:
        if value is None:
            raise ValueError("null is no value of this field; leave it out to keep what is there")
        return value


class WebhookOut(Out):
    """A webhook, without its secret."""

    id: str
    name: str
    url: str
    format: WebhookFormat
    kinds: list[AlertKind] | None
    enabled: bool
    disabled_reason: str | None
    disabled_reason_code: ReasonCode | None
    pending: int
    delivered_at: datetime | None
    failing_since: datetime | None
    held_until: datetime | None
    last_error: str | None
    old_secret_until: datetime | None
    created_at: datetime
    updated_at: datetime

    @classmethod
    def from_record(cls, record: WebhookRecord, **more: Any) -> Self:
        """The body of a webhook, with how many messages are pending, and a secret just made."""
        why = record.disabled_reasons
        words, code = in_words(why) or None, code_of(why)
        return cls.of(record, disabled_reason=words, disabled_reason_code=code, **more)


class WebhookMade(WebhookOut):
    """A webhook just made: the one answer, beside that of a rotation, that has the secret."""

    secret: str | None


class SecretOut(Out):
    """A new secret; until `old_secret_until` messages are signed with the old one, too."""

    secret: str
    old_secret_until: datetime


class WebhookList(BaseModel):
    """Webhooks, oldest first."""

    items: list[WebhookOut]


class AttemptOut(Out):
    """One request of a delivery."""

    started_at: datetime
    duration_s: float
    status_code: int | None
    error: str | None


class DeliveryOut(Out):
    """A delivery; `id` is the `webhook-id` that the receiver sees, at every attempt."""

    id: str
    webhook_id: str
    type: MessageType
    alert_id: str | None
    state: DeliveryState
    payload: dict[str, Any]
    attempts: list[AttemptOut]
    next_attempt_at: datetime | None
    created_at: datetime
    finished_at: datetime | None

    @classmethod
    def from_record(cls, record: DeliveryRecord) -> Self:
        """The body of a delivery."""
        attempts = [
            AttemptOut.model_validate(each, from_attributes=True) for each in record.requests
        ]
        return cls.of(record, attempts=attempts)


class DeliveryList(BaseModel):
    """Deliveries, newest first."""

    items: list[DeliveryOut]


router = APIRouter(tags=["webhooks"], route_class=NamingRoute)


def checked_body(body: WebhookBody, state: StateDep) -> WebhookBody:
    """The body, whose URL was checked while no transaction is open: resolvers may be slow."""
    webhooks.require_url(state.settings, body.url)
    return body


def checked_patch(body: WebhookPatch, state: StateDep) -> WebhookPatch:
    """The same of a change."""
    if body.url is not None:
        webhooks.require_url(state.settings, body.url)
    return body


CheckedBody = Annotated[WebhookBody, Depends(checked_body)]
CheckedPatch = Annotated[WebhookPatch, Depends(checked_patch)]


@router.post("/webhooks", status_code=201)
def create_webhook(
    body: CheckedBody, state: StateDep, session: WriteDep, response: Response
) -> WebhookMade:
    """Create a webhook.

    Its secret is in this answer only.
    """
    spec = WebhookSpec(**body.model_dump())
    made = webhooks.create_webhook(session, state.settings, spec)
    response.headers["Location"] = f"/webhooks/{made.record.id}"
    return WebhookMade.from_record(made.record, pending=0, secret=made.secret)


@router.get("/webhooks")
def list_webhooks(session: ReadDep) -> WebhookList:
    """List the webhooks, oldest first."""
    return WebhookList(items=[_shown(view) for view in webhooks.list_webhooks(session)])


@router.get("/webhooks/{webhook_id}")
def get_webhook(webhook_id: str, session: ReadDep) -> WebhookOut:
    """Get a webhook with the state of its deliveries."""
    return _shown(webhooks.show_webhook(session, webhook_id))


@router.patch("/webhooks/{webhook_id}")
def change_webhook(
    webhook_id: str, body: CheckedPatch, state: StateDep, session: WriteDep
) -> WebhookOut:
    """Change a webhook.

    With another URL, or enabled again, it receives the deliveries that are waiting.
    """
    changes = body.model_dump(exclude_unset=True)
    return _shown(webhooks.change_webhook(session, state.queue, webhook_id, changes))


@router.delete("/webhooks/{webhook_id}", status_code=204)
def delete_webhook(webhook_id: str, session: WriteDep) -> None:
    """Delete a webhook with its deliveries."""
    webhooks.remove_webhook(session, webhook_id)


@router.post("/webhooks/{webhook_id}/secret")
def rotate_webhook_secret(webhook_id: str, state: StateDep, session: WriteDep) -> SecretOut:
    """Replace the secret of a webhook.

    For one day, messages are signed with the former secret, too.
    """
    made = webhooks.rotate_secret(session, state.settings, webhook_id)
    return SecretOut.of(made.record, secret=made.secret)


@router.post("/webhooks/{webhook_id}/test", status_code=202)
def test_webhook(webhook_id: str, session: WriteDep) -> DeliveryOut:
    """Send a test message to a webhook.

    A message of the type `test` is queued.
    """
    return DeliveryOut.from_record(webhooks.test_webhook(session, webhook_id))


@router.get("/webhooks/{webhook_id}/deliveries")
def list_deliveries(
    webhook_id: str,
    session: ReadDep,
    state: DeliveryState | None = None,
    limit: Annotated[int, Query(ge=1, le=1000)] = 100,
) -> DeliveryList:
    """List the deliveries of a webhook, newest first.

    Each has its attempts; pending ones are included.
    """
    records = webhooks.list_deliveries(session, webhook_id, state, limit)
    return DeliveryList(items=[DeliveryOut.from_record(record) for record in records])


@router.get("/deliveries/{delivery_id}")
def get_delivery(delivery_id: str, session: ReadDep) -> DeliveryOut:
    """Get a delivery with its attempts."""
    return DeliveryOut.from_record(webhooks.show_delivery(session, delivery_id))


@router.post("/deliveries/{delivery_id}/replay", status_code=202)
def replay_delivery(delivery_id: str, state: StateDep, session: WriteDep) -> DeliveryOut:
    """Send a delivery again.

    It is sent at once, with the same `webhook-id`.
    """
    return DeliveryOut.from_record(webhooks.replay_delivery(session, state.queue, delivery_id))


def _shown(view: WebhookView) -> WebhookOut:
    return WebhookOut.from_record(view.record, pending=view.pending)
