"""The log of what was done: it only grows, and outlives what it tells of."""

from collections.abc import Sequence
from datetime import datetime
from typing import Any

from sqlalchemy import Index, String, select
from sqlalchemy.orm import Mapped, Session, mapped_column

from service.enums import Activity, AlertKind, Outcome
from service.store.engines.following import mark_entry, settled
from service.store.record import Record, delete_some, newest_first


class ActivityRecord(Record):
    """An act of somebody, or of the service where `by` is None.

    `camera_id` refers to
    nothing, so that it stays when the camera goes; `subject_id` is the alert's, training's or
    window's, `via` the token's. `kind` and `outcome` are an alert's, `until` of a silence or of
    maintenance; `note` has the words that were given. Triggers refuse changes, and deletions of
    what is younger than 30 days.
    """

    __tablename__ = "activity"

    id: Mapped[int] = mapped_column(primary_key=True)
    at: Mapped[datetime]
    what: Mapped[Activity]
    by: Mapped[str | None]
    via: Mapped[str | None]
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
        Index(None, "at"),
        {"sqlite_autoincrement": True},  # an id is never given twice
    )


def add(session: Session, record: ActivityRecord) -> None:
    """Append an entry in the transaction of what it tells of."""
    mark_entry(session, ActivityRecord)
    session.add(record)


def after(
    session: Session, camera_id: str | None, entry_id: int, limit: int
) -> Sequence[ActivityRecord]:
    """Entries after one, oldest first; of a camera, or of everything."""
    query = select(ActivityRecord).where(
        ActivityRecord.id > entry_id, *settled(session, ActivityRecord)
    )
    if camera_id is not None:
        query = query.where(ActivityRecord.camera_id == camera_id)
    return session.scalars(query.order_by(ActivityRecord.id).limit(limit)).all()


def newest(session: Session, camera_id: str, limit: int) -> Sequence[ActivityRecord]:
    """The newest entries of a camera, newest first."""
    return session.scalars(newest_first(ActivityRecord, camera_id).limit(limit)).all()


def of_subject(session: Session, subject_id: str) -> Sequence[ActivityRecord]:
    """The entries of an alert, a training or a window, oldest first."""
    return session.scalars(
        select(ActivityRecord)
        .where(ActivityRecord.subject_id == subject_id)
        .order_by(ActivityRecord.id)
    ).all()


def forget(session: Session, before: datetime, limit: int) -> int:
    """Delete at most so many of the entries of before a time, oldest first. Returns how many."""
    oldest = (
        select(ActivityRecord.id)
        .where(ActivityRecord.at < before)
        .order_by(ActivityRecord.id)
        .limit(limit)
    )
    return delete_some(session, ActivityRecord.id, oldest)
