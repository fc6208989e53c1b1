"""Statements on estimates, the history of the served pose."""

from collections.abc import Sequence
from datetime import datetime

from sqlalchemy import delete, select
from sqlalchemy.orm import Session

from service.store.tables import EstimateRecord


def newest(session: Session, camera_id: str) -> EstimateRecord | None:
    """The estimate that is served, or None."""
    return session.scalars(
        select(EstimateRecord)
        .where(EstimateRecord.camera_id == camera_id)
        .order_by(EstimateRecord.id.desc())
        .limit(1)
    ).first()


def newest_of_earlier(session: Session, camera_id: str, reference_id: int) -> EstimateRecord | None:
    """The last estimate under an earlier reference, or None."""
    return session.scalars(
        select(EstimateRecord)
        .where(EstimateRecord.camera_id == camera_id, EstimateRecord.reference_id < reference_id)
        .order_by(EstimateRecord.id.desc())
        .limit(1)
    ).first()


def between(
    session: Session, camera_id: str, start: datetime | None, end: datetime | None, limit: int
) -> Sequence[EstimateRecord]:
    """The newest so many estimates made between two times, oldest first."""
    query = select(EstimateRecord).where(EstimateRecord.camera_id == camera_id)
    if start is not None:
        query = query.where(EstimateRecord.created_at >= start)
    if end is not None:
        query = query.where(EstimateRecord.created_at <= end)
    return session.scalars(query.order_by(EstimateRecord.id.desc()).limit(limit)).all()[::-1]


def forget(session: Session, camera_id: str, keep: int) -> None:
    """Delete all but the newest so many."""
    surplus = (
        select(EstimateRecord.id)
        .where(EstimateRecord.camera_id == camera_id)
        .order_by(EstimateRecord.id.desc())
        .offset(keep)
    )
    session.execute(delete(EstimateRecord).where(EstimateRecord.id.in_(surplus)))
