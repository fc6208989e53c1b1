"""Statements on the log of what was done."""

from collections.abc import Sequence
from datetime import datetime

from sqlalchemy import select
from sqlalchemy.orm import Session

from service.store.database.deleting import delete_some
from service.store.database.following import mark_entry, settled
from service.store.tables.activity import ActivityRecord


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
    return session.scalars(
        select(ActivityRecord)
        .where(ActivityRecord.camera_id == camera_id)
        .order_by(ActivityRecord.id.desc())
        .limit(limit)
    ).all()


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
