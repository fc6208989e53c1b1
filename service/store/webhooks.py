"""Webhooks, their deliveries and attempts."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import (
    JSON,
    ColumnElement,
    ForeignKey,
    Index,
    String,
    exists,
    func,
    or_,
    select,
    update,
)
from sqlalchemy.orm import Mapped, Session, aliased, mapped_column, relationship, selectinload

from models.reasons import Reason
from service.enums import AlertKind, AlertState, DeliveryState, MessageType, WebhookFormat
from service.reasons import Reasons
from service.store.alerts import AlertRecord, told_by
from service.store.record import Record, delete_some


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

    def disable(self, why: Reason) -> None:
        """Send nothing more to it, until a person enables it."""
        self.enabled, self.disabled_reasons = False, (why,)


class DeliveryRecord(Record):
    """A message for an endpoint, written with the change that it tells of; `id` is `webhook-id`.

    `queued_at` is when it was made or last replayed, `tries` counts the attempts since, `attempts`
    all of them, its `requests`, oldest first. Its alert may be gone, and is no foreign key.
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
    requests: Mapped[list["DeliveryAttemptRecord"]] = relationship(
        order_by="DeliveryAttemptRecord.id", viewonly=True
    )

    __table_args__ = (
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Backlog:
    """Deliveries that wait for a webhook, and since when."""

    count: int
    oldest_at: datetime


_Earlier = aliased(DeliveryRecord)


def every(session: Session) -> Sequence[WebhookRecord]:
    """All webhooks, oldest first."""
    return session.scalars(select(WebhookRecord).order_by(WebhookRecord.created_at)).all()


def enabled(session: Session) -> Sequence[WebhookRecord]:
    """Those that messages are made for."""
    query = select(WebhookRecord).where(WebhookRecord.enabled)
    return session.scalars(query.order_by(WebhookRecord.created_at)).all()


def backlogs(session: Session) -> dict[str, Backlog]:
    """The backlog of each webhook that something waits for."""
    rows = session.execute(
        select(DeliveryRecord.webhook_id, func.count(), func.min(DeliveryRecord.created_at))
        .where(DeliveryRecord.state == DeliveryState.PENDING)
        .group_by(DeliveryRecord.webhook_id)
    )
    return {name: Backlog(count=count, oldest_at=oldest) for name, count, oldest in rows}


def find_delivery(session: Session, delivery_id: str) -> DeliveryRecord | None:
    """The delivery, or None."""
    return session.scalars(select(DeliveryRecord).where(DeliveryRecord.id == delivery_id)).first()


def log(
    session: Session, webhook_id: str, state: DeliveryState | None, limit: int
) -> Sequence[DeliveryRecord]:
    """A webhook's deliveries with their requests, newest first."""
    query = select(DeliveryRecord).where(DeliveryRecord.webhook_id == webhook_id)
    if state is not None:
        query = query.where(DeliveryRecord.state == state)
    query = query.options(selectinload(DeliveryRecord.requests))
    return session.scalars(query.order_by(DeliveryRecord.number.desc()).limit(limit)).all()


def next_due(session: Session, webhook_id: str, now: datetime) -> DeliveryRecord | None:
    """The oldest delivery that is due, and does not wait for an earlier one of its alert."""
    waits = exists().where(
        _Earlier.webhook_id == webhook_id,
        _Earlier.state == DeliveryState.PENDING,
        _Earlier.alert_id == DeliveryRecord.alert_id,
        _Earlier.number < DeliveryRecord.number,
    )
    return session.scalars(
        select(DeliveryRecord)
        .where(
            DeliveryRecord.webhook_id == webhook_id,
            DeliveryRecord.state == DeliveryState.PENDING,
            _has_come(now),
            ~waits,
        )
        .order_by(DeliveryRecord.number)
        .limit(1)
    ).first()


def due(session: Session, now: datetime) -> set[str]:
    """The ids of webhooks that have a delivery whose time has come."""
    return set(
        session.scalars(
            select(DeliveryRecord.webhook_id)
            .where(DeliveryRecord.state == DeliveryState.PENDING, _has_come(now))
            .distinct()
        )
    )


def waiting(session: Session, now: datetime) -> Sequence[DeliveryRecord]:
    """Deliveries whose next attempt is yet to come."""
    return session.scalars(
        select(DeliveryRecord).where(
            DeliveryRecord.state == DeliveryState.PENDING, DeliveryRecord.next_attempt_at > now
        )
    ).all()


def bring_forward(session: Session, webhook_id: str, now: datetime, refused: Sequence[int]) -> None:
    """Make due what waits on a webhook that answers again, but for what it itself refused."""
    session.execute(
        update(DeliveryRecord)
        .where(
            DeliveryRecord.webhook_id == webhook_id,
            DeliveryRecord.state == DeliveryState.PENDING,
            DeliveryRecord.next_attempt_at > now,
            or_(DeliveryRecord.status_code.is_(None), DeliveryRecord.status_code.not_in(refused)),
        )
        .values(next_attempt_at=now)
    )


def give_up(session: Session, before: datetime, now: datetime, limit: int) -> int:
    """End up to `limit` that have waited since before a time, on a disabled webhook say."""
    bite = (
        select(DeliveryRecord.number)
        .where(DeliveryRecord.state == DeliveryState.PENDING, DeliveryRecord.queued_at < before)
        .limit(limit)
    )
    result = session.execute(
        update(DeliveryRecord)
        .where(DeliveryRecord.number.in_(bite))
        .values(state=DeliveryState.FAILED, finished_at=now, next_attempt_at=None)
    )
    return int(result.rowcount)  # type: ignore[attr-defined]


def forget(session: Session, before: datetime, limit: int) -> int:
    """Delete up to `limit` deliveries that ended before a time, with attempts; how many."""
    bite = select(DeliveryRecord.number).where(DeliveryRecord.finished_at < before).limit(limit)
    return delete_some(session, DeliveryRecord.number, bite)


def forget_old_secrets(session: Session, now: datetime, limit: int) -> int:
    """Delete secrets that nothing is signed with any more. Returns how many."""
    bite = (
        select(WebhookRecord.id)
        .where(WebhookRecord.old_secret.is_not(None), WebhookRecord.old_secret_until < now)
        .limit(limit)
    )
    result = session.execute(
        update(WebhookRecord).where(WebhookRecord.id.in_(bite)).values(old_secret=None)
    )
    return int(result.rowcount)  # type: ignore[attr-defined]


def audible(session: Session, kinds: Sequence[str] | None, now: datetime) -> Sequence[AlertRecord]:
    """Alerts that fire and are not silenced, of some kinds or all; a group for its members."""
    query = select(AlertRecord).where(
        AlertRecord.state == AlertState.FIRING,
        AlertRecord.group_id.is_(None),
        or_(AlertRecord.silenced_until.is_(None), AlertRecord.silenced_until <= now),
    )
    if kinds is not None:
        query = query.where(
            AlertRecord.kind.in_([k for k in AlertKind if not told_by(k).isdisjoint(kinds)])
        )
    return session.scalars(query.order_by(AlertRecord.opened_at)).all()


def _has_come(now: datetime) -> ColumnElement[bool]:
    """The condition that a delivery is due. One that was never tried is, by any clock."""
    return or_(DeliveryRecord.next_attempt_at <= now, DeliveryRecord.tries == 0)
