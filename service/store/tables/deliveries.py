"""Records of webhooks and of what is delivered to them."""

from datetime import datetime
from typing import Any

from sqlalchemy import JSON, ForeignKey, Index, String
from sqlalchemy.orm import Mapped, mapped_column

from models.reasons import Reason
from service.enums import DeliveryState, MessageType, WebhookFormat
from service.reasons import Reasons
from service.store.tables.record import Record, one_of


class WebhookRecord(Record):
    """An endpoint that alerts are delivered to: a Standard Webhooks receiver, or an Alertmanager.

    `job_queued_at` is set while a delivery job waits to start. Until `held_until` nothing is sent:
    the endpoint as a whole failed a moment ago. `failing_since` is the first failure after the last
    success. Secrets are sealed with the data directory's key.
    """

    __tablename__ = "webhooks"

    id: Mapped[str] = mapped_column(String(32), primary_key=True)
    name: Mapped[str]
    url: Mapped[str]
    format: Mapped[WebhookFormat]
    kinds: Mapped[list[str] | None] = mapped_column(JSON(none_as_null=True))  # None: all
    enabled: Mapped[bool]
    disabled_reasons: Mapped[Reasons] = mapped_column(default=())
    secret: Mapped[str | None]
    old_secret: Mapped[str | None]
    old_secret_until: Mapped[datetime | None]
    job_queued_at: Mapped[datetime | None]
    held_until: Mapped[datetime | None]
    failing_since: Mapped[datetime | None]
    last_error: Mapped[str | None]
    delivered_at: Mapped[datetime | None]
    refreshed_at: Mapped[datetime | None]  # when an Alertmanager was last told all that fires
    created_at: Mapped[datetime]
    updated_at: Mapped[datetime]

    __table_args__ = (one_of("format", WebhookFormat),)

    def disable(self, why: Reason) -> None:
        """Send nothing more to it, until a person enables it."""
        self.enabled, self.disabled_reasons = False, (why,)


class DeliveryRecord(Record):
    """A message for an endpoint, written with the change that it tells of; `id` is `webhook-id`.

    `queued_at` is when it was made or last replayed, `tries` counts the attempts since, `attempts`
    all of them. Its alert may be gone, and is no foreign key.
    """

    __tablename__ = "deliveries"

    number: Mapped[int] = mapped_column(primary_key=True)
    id: Mapped[str] = mapped_column(String(32), unique=True)
    webhook_id: Mapped[str] = mapped_column(ForeignKey("webhooks.id", ondelete="CASCADE"))
    alert_id: Mapped[str | None] = mapped_column(String(32))
    type: Mapped[MessageType]
    payload: Mapped[dict[str, Any]]
    state: Mapped[DeliveryState]
    attempts: Mapped[int]
    tries: Mapped[int]
    next_attempt_at: Mapped[datetime | None]
    queued_at: Mapped[datetime]
    status_code: Mapped[int | None]
    error: Mapped[str | None]
    created_at: Mapped[datetime]
    finished_at: Mapped[datetime | None]

    __table_args__ = (
        one_of("type", MessageType),
        one_of("state", DeliveryState),
        Index(None, "webhook_id", "state", "number"),
        Index(None, "state", "next_attempt_at"),
        {"sqlite_autoincrement": True},  # numbers are the order of what happened
    )


class DeliveryAttemptRecord(Record):
    """One request of a delivery: its status code, or why there is none."""

    __tablename__ = "delivery_attempts"

    id: Mapped[int] = mapped_column(primary_key=True)
    delivery_number: Mapped[int] = mapped_column(
        ForeignKey("deliveries.number", ondelete="CASCADE"), index=True
    )
    started_at: Mapped[datetime]
    duration_s: Mapped[float]
    status_code: Mapped[int | None]
    error: Mapped[str | None]
