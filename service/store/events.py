"""Events, for `GET /events`."""

from collections.abc import Sequence
from datetime import datetime
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Mapped, Session, mapped_column

from service.enums import EventType
from service.store.engines.following import mark_entry, newest_settled, settled
from service.store.record import Record, delete_some


class EventRecord(Record):
    """Something that happened, for `GET /events`."""

    __tablename__ = "events"

    id: Mapped[int] = mapped_column(primary_key=True)
    type: Mapped[EventType]
    payload: Mapped[dict[str, Any]]
    created_at: Mapped[datetime]

    __table_args__ = ({"sqlite_autoincrement": True},)  # an id is never given twice


def add(session: Session, type_: EventType, payload: dict[str, Any], now: datetime) -> None:
    """Append an event in the transaction of what it tells of."""
    mark_entry(session, EventRecord)
    session.add(EventRecord(type=type_, payload=payload, created_at=now))


def after(session: Session, event_id: int, limit: int) -> Sequence[EventRecord]:
    """Events after one, oldest first."""
    query = select(EventRecord).where(EventRecord.id > event_id, *settled(session, EventRecord))
    return session.scalars(query.order_by(EventRecord.id).limit(limit)).all()


def newest_id(session: Session) -> int:
    """The id that all events so far have or are below; 0 without any."""
    return newest_settled(session, EventRecord)


def forget(session: Session, keep: int, limit: int) -> int:
    """Delete up to `limit` of all but the newest so many, oldest first. Returns how many."""
    newest = select(EventRecord.id).order_by(EventRecord.id.desc()).offset(keep).limit(1)
    surplus = select(EventRecord.id).where(EventRecord.id <= newest.scalar_subquery())
    bite = surplus.order_by(EventRecord.id).limit(limit)
    return delete_some(session, EventRecord.id, bite)
