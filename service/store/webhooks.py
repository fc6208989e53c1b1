"""Statements on webhooks, their deliveries and attempts."""

from collections.abc import Sequence
from datetime import datetime

from sqlalchemy import ColumnElement, exists, func, or_, select, update
from sqlalchemy.orm import Session, aliased

from service.enums import AlertState, DeliveryState
from service.store.database.deleting import delete_some
from service.store.tables.alerts import AlertRecord
from service.store.tables.deliveries import DeliveryAttemptRecord, DeliveryRecord, WebhookRecord

_Earlier = aliased(DeliveryRecord)


def find(session: Session, webhook_id: str) -> WebhookRecord | None:
    """The webhook, or None."""
    return session.get(WebhookRecord, webhook_id)


def every(session: Session) -> Sequence[WebhookRecord]:
    """All webhooks, oldest first."""
    return session.scalars(select(WebhookRecord).order_by(WebhookRecord.created_at)).all()


def enabled(session: Session) -> Sequence[WebhookRecord]:
    """Those that messages are made for."""
    query = select(WebhookRecord).where(WebhookRecord.enabled)
    return session.scalars(query.order_by(WebhookRecord.created_at)).all()


def pending(session: Session) -> dict[str, int]:
    """How many deliveries of each webhook wait."""
    rows = session.execute(
        select(DeliveryRecord.webhook_id, func.count())
        .where(DeliveryRecord.state == DeliveryState.PENDING)
        .group_by(DeliveryRecord.webhook_id)
    )
    return {webhook_id: count for webhook_id, count in rows}


def find_delivery(session: Session, delivery_id: str) -> DeliveryRecord | None:
    """The delivery, or None."""
    return session.scalars(select(DeliveryRecord).where(DeliveryRecord.id == delivery_id)).first()


def log(
    session: Session, webhook_id: str, state: DeliveryState | None, limit: int
) -> Sequence[DeliveryRecord]:
    """A webhook's deliveries, newest first."""
    query = select(DeliveryRecord).where(DeliveryRecord.webhook_id == webhook_id)
    if state is not None:
        query = query.where(DeliveryRecord.state == state)
    return session.scalars(query.order_by(DeliveryRecord.number.desc()).limit(limit)).all()


def attempts_of(session: Session, numbers: Sequence[int]) -> dict[int, list[DeliveryAttemptRecord]]:
    """The attempts of some deliveries, oldest first, by the deliveries' numbers."""
    found: dict[int, list[DeliveryAttemptRecord]] = {number: [] for number in numbers}
    for attempt in session.scalars(
        select(DeliveryAttemptRecord)
        .where(DeliveryAttemptRecord.delivery_number.in_(numbers))
        .order_by(DeliveryAttemptRecord.id)
    ):
        found[attempt.delivery_number].append(attempt)
    return found


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
        query = query.where(AlertRecord.kind.in_(kinds))
    return session.scalars(query.order_by(AlertRecord.opened_at)).all()


def _has_come(now: datetime) -> ColumnElement[bool]:
    """Whether it is time for a delivery. For one that was never tried it is, by any clock."""
    return or_(DeliveryRecord.next_attempt_at <= now, DeliveryRecord.tries == 0)
