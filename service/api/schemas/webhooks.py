"""Bodies of `/webhooks` and `/deliveries`."""

from datetime import datetime
from typing import Annotated, Any, Self

from pydantic import BaseModel, Field, field_validator

from service.api.schemas.base import Body
from service.api.schemas.reasons import ReasonCode
from service.enums import AlertKind, DeliveryState, MessageType, WebhookFormat
from service.notifications.webhooks import DeliveryView, SecretMade, WebhookView
from service.reason_words import in_words
from service.reasons import code_of
from service.store.tables.deliveries import WebhookRecord

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


class WebhookOut(BaseModel):
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
    def from_value(cls, view: WebhookView) -> Self:
        """The body of a webhook."""
        return cls.model_validate({**_fields(view.record), "pending": view.pending})


class WebhookMade(WebhookOut):
    """A webhook just made: the one answer, beside that of a rotation, that has the secret."""

    secret: str | None

    @classmethod
    def from_made(cls, made: SecretMade) -> Self:
        """The body of a new webhook."""
        return cls.model_validate({**_fields(made.record), "pending": 0, "secret": made.secret})


class SecretOut(BaseModel):
    """A new secret; until `old_secret_until` messages are signed with the old one, too."""

    secret: str
    old_secret_until: datetime


class WebhookList(BaseModel):
    """Webhooks, oldest first."""

    items: list[WebhookOut]


class AttemptOut(BaseModel):
    """One request of a delivery."""

    started_at: datetime
    duration_s: float
    status_code: int | None
    error: str | None


class DeliveryOut(BaseModel):
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
    def from_value(cls, view: DeliveryView) -> Self:
        """The body of a delivery."""
        attempts = [
            AttemptOut.model_validate(attempt, from_attributes=True) for attempt in view.attempts
        ]
        own = {name: getattr(view.record, name) for name in cls.model_fields if name != "attempts"}
        return cls(**own, attempts=attempts)


class DeliveryList(BaseModel):
    """Deliveries, newest first."""

    items: list[DeliveryOut]


def _fields(record: WebhookRecord) -> dict[str, Any]:
    names = WebhookOut.model_fields.keys() - {"pending", "disabled_reason", "disabled_reason_code"}
    why = record.disabled_reasons
    return {
        **{name: getattr(record, name) for name in names},
        "disabled_reason": in_words(why) or None,
        "disabled_reason_code": code_of(why),
    }
