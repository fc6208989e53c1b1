"""The two tables that only grow and are read on from an id: events, and the log of what was done.

On SQLite one writes after the other, and ids are given in the order of commits. On PostgreSQL a row
may get an id, and be committed after one with a larger id has been read. Whoever adds rows says so
by a lock before, in whose key is the last id that was given by then: as long as it is held, up to
the end of the transaction, nobody reads beyond that id. No one ever waits for these locks.
"""

from collections.abc import Collection, Sequence
from datetime import datetime
from typing import Any

from sqlalchemy import ColumnElement, Index, String, TextClause, func, select, text
from sqlalchemy.orm import Mapped, Session, mapped_column

from service.enums import Activity, AlertKind, EventType, Outcome
from service.store.engines.dialects import is_sqlite
from service.store.record import Record, delete_some, newest_first


class EventRecord(Record):
    """Something that happened, for `GET /events`."""

    __tablename__ = "events"

    id: Mapped[int] = mapped_column(primary_key=True)
    type: Mapped[EventType]
    payload: Mapped[dict[str, Any]]
    created_at: Mapped[datetime]

    __table_args__ = ({"sqlite_autoincrement": True},)  # an id is never given twice


class ActivityRecord(Record):
    """An act of somebody, or of the service where `by` is None.

    `via` is the token's id, `address` where the request came from.

    `camera_id` refers to nothing, so that it stays when the camera goes; `subject_id` is the
    alert's, training's or window's. `kind` and `outcome` are an alert's, `until`
    of a silence or of maintenance; `note` has the words that were given. Triggers refuse changes,
    and deletions of what is younger than 30 days.
    """

    __tablename__ = "activity"

    id: Mapped[int] = mapped_column(primary_key=True)
    at: Mapped[datetime]
    what: Mapped[Activity]
    by: Mapped[str | None]
    via: Mapped[str | None]
    address: Mapped[str | None]
    camera_id: Mapped[str | None] = mapped_column(String(64))
    subject_id: Mapped[str | None] = mapped_column(String(64))
    kind: Mapped[AlertKind | None]
    until: Mapped[datetime | None]
    outcome: Mapped[Outcome | None]
    note: Mapped[str | None]
    details: Mapped[dict[str, Any]]

    __table_args__ = (
        Index(None, "camera_id", "id"),
        Index(None, "subject_id", "id"),
        Index(None, "what", "id"),
        Index(None, "at"),
        {"sqlite_autoincrement": True},  # an id is never given twice
    )


# Above the 48 bits of an id in the key of a lock; for each table its own.
_PREFIXES = {"events": 0x5F07, "activity": 0x5F08}
_GIVEN = "SELECT CASE WHEN is_called THEN last_value ELSE 0 END FROM {table}_id_seq"
_MARK = (
    "SELECT pg_advisory_xact_lock_shared((CAST({prefix} AS bigint) << 48) "
    "| CASE WHEN is_called THEN last_value ELSE 0 END) FROM {table}_id_seq"
)
_MARKED = (
    "SELECT min(((CAST(classid AS bigint) & 65535) << 32) | CAST(objid AS bigint)) FROM pg_locks "
    "WHERE locktype = 'advisory' AND objsubid = 1 AND CAST(classid AS bigint) >> 16 = {prefix} "
    "AND database = (SELECT oid FROM pg_database WHERE datname = current_database())"
)


def append(session: Session, record: EventRecord | ActivityRecord) -> None:
    """Append an entry in the transaction of what it tells of."""
    if not is_sqlite(session.get_bind()):
        session.execute(_of_table(_MARK, type(record)))
    session.add(record)


def add_event(session: Session, type_: EventType, payload: dict[str, Any], now: datetime) -> None:
    """Append an event."""
    append(session, EventRecord(type=type_, payload=payload, created_at=now))


def events_after(session: Session, event_id: int, limit: int) -> Sequence[EventRecord]:
    """Events after one, oldest first."""
    query = select(EventRecord).where(EventRecord.id > event_id, *_settled(session, EventRecord))
    return session.scalars(query.order_by(EventRecord.id).limit(limit)).all()


def newest_event_id(session: Session) -> int:
    """The id that all events so far have or are below; 0 without any."""
    if is_sqlite(session.get_bind()):
        return session.scalar(select(func.max(EventRecord.id))) or 0
    return _horizon(session, EventRecord)


def forget_events(session: Session, keep: int, limit: int) -> int:
    """Delete up to `limit` of all but the newest so many, oldest first. Returns how many."""
    newest = select(EventRecord.id).order_by(EventRecord.id.desc()).offset(keep).limit(1)
    surplus = select(EventRecord.id).where(EventRecord.id <= newest.scalar_subquery())
    return delete_some(session, EventRecord.id, surplus.order_by(EventRecord.id).limit(limit))


def activity_after(
    session: Session,
    camera_id: str | None,
    entry_id: int,
    limit: int,
    *,
    since: datetime | None = None,
    before: datetime | None = None,
    from_newest: bool = False,
) -> Sequence[ActivityRecord]:
    """Entries after one, oldest first unless said; of a camera, or of everything; of some times."""
    query = select(ActivityRecord).where(
        ActivityRecord.id > entry_id, *_settled(session, ActivityRecord)
    )
    if camera_id is not None:
        query = query.where(ActivityRecord.camera_id == camera_id)
    if since is not None:
        query = query.where(ActivityRecord.at >= since)
    if before is not None:
        query = query.where(ActivityRecord.at < before)
    order = ActivityRecord.id.desc() if from_newest else ActivityRecord.id
    return session.scalars(query.order_by(order).limit(limit)).all()


def newest_activity(session: Session, camera_id: str, limit: int) -> Sequence[ActivityRecord]:
    """The newest entries of a camera, newest first."""
    return session.scalars(newest_first(ActivityRecord, camera_id).limit(limit)).all()


def newest_of(
    session: Session, camera_id: str, what: Collection[Activity]
) -> ActivityRecord | None:
    """The newest entry of a camera that is one of some; None where there is none."""
    query = newest_first(ActivityRecord, camera_id).where(ActivityRecord.what.in_(what))
    return session.scalars(query.limit(1)).first()


def newest_of_kind(session: Session, what: Activity) -> ActivityRecord | None:
    """The newest entry of a kind; None where there is none."""
    return next(iter(newest_entries(session, what, 1)), None)


def newest_entries(session: Session, what: Activity, limit: int) -> Sequence[ActivityRecord]:
    """The newest entries of a kind, newest first."""
    query = select(ActivityRecord).where(ActivityRecord.what == what)
    return session.scalars(query.order_by(ActivityRecord.id.desc()).limit(limit)).all()


def entries_about(
    session: Session, what: Activity, subject_ids: Collection[str | None]
) -> dict[str | None, ActivityRecord]:
    """The entry of a kind about each of some subjects that has one."""
    if not subject_ids:
        return {}
    query = select(ActivityRecord).where(
        ActivityRecord.what == what, ActivityRecord.subject_id.in_(subject_ids)
    )
    return {entry.subject_id: entry for entry in session.scalars(query)}


def activity_of_subject(session: Session, subject_id: str) -> Sequence[ActivityRecord]:
    """The entries of an alert, a training or a window, oldest first."""
    query = select(ActivityRecord).where(ActivityRecord.subject_id == subject_id)
    return session.scalars(query.order_by(ActivityRecord.id)).all()


def forget_activity(session: Session, before: datetime, limit: int) -> int:
    """Delete at most so many of the entries of before a time, oldest first. Returns how many."""
    oldest = select(ActivityRecord.id).where(ActivityRecord.at < before)
    return delete_some(session, ActivityRecord.id, oldest.order_by(ActivityRecord.id).limit(limit))


def _settled(session: Session, record: type[Any]) -> list[ColumnElement[bool]]:
    """The condition that nothing will come before a row any more; SQLite's rows are all so."""
    if is_sqlite(session.get_bind()):
        return []
    return [record.id <= _horizon(session, record)]


def _horizon(session: Session, record: type[Any]) -> int:
    # In this order: who marks itself after the second look is given an id after the first one.
    given = int(session.scalars(_of_table(_GIVEN, record)).one())
    marked = session.scalars(_of_table(_MARKED, record)).one()
    return given if marked is None else min(given, int(marked))


def _of_table(statement: str, record: type[Any]) -> TextClause:
    table = record.__tablename__
    return text(statement.format(table=table, prefix=_PREFIXES[table]))
