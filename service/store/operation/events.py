"""Statements on events."""

from collections.abc import Sequence
from datetime import datetime
from typing import Any

from sqlalchemy import delete, func, select
from sqlalchemy.orm import Session

from service.kinds import EventType
from service.store.tables.operation import EventRecord


def add(session: Session, type_: EventType, payload: dict[str, Any], now: datetime) -> None:
    """Append an event in the transaction of what it tells of."""
    session.add(EventRecord(type=type_, payload=payload, created_at=now))


def after(session: Session, event_id: int, limit: int) -> Sequence[EventRecord]:
    """Events after one, oldest first."""
    query = select(EventRecord).where(EventRecord.id > event_id)
    return session.scalars(query.order_by(EventRecord.id).limit(limit)).all()


def newest_id(session: Session) -> int:
    """The id of the newest event; 0 without any."""
    return session.scalar(select(func.max(EventRecord.id))) or 0


def forget(session: Session, keep: int, limit: int) -> int:
    """Delete up to `limit` of all but the newest so many, oldest first. Returns how many."""
    surplus = select(EventRecord.id).where(EventRecord.id <= newest_id(session) - keep)
    bite = surplus.order_by(EventRecord.id).limit(limit)
    result = session.execute(delete(EventRecord).where(EventRecord.id.in_(bite)))
    return int(result.rowcount)  # type: ignore[attr-defined]
