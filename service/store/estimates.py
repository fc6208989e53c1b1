"""Statements on estimates, the history of the served pose."""

from collections.abc import Sequence
from datetime import datetime

from sqlalchemy import ColumnElement, func, select
from sqlalchemy.orm import Session

from service.store.database.deleting import delete_some
from service.store.tables.estimates import EstimateRecord


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
    query = select(EstimateRecord).where(*_made_between(camera_id, start, end))
    return session.scalars(query.order_by(EstimateRecord.id.desc()).limit(limit)).all()[::-1]


def thinned(
    session: Session, camera_id: str, start: datetime | None, end: datetime | None, most: int
) -> Sequence[EstimateRecord]:
    """Every so many-th of the estimates made between two times, oldest first; the newest is one."""
    wanted = _made_between(camera_id, start, end)
    count = session.scalar(select(func.count()).where(*wanted)) or 0
    number = func.row_number().over(order_by=EstimateRecord.id.desc()).label("number")
    numbered = select(EstimateRecord.id, number).where(*wanted).subquery()
    every = max(-(-count // most), 1)
    kept = select(numbered.c.id).where((numbered.c.number - 1) % every == 0)
    query = select(EstimateRecord).where(EstimateRecord.id.in_(kept)).order_by(EstimateRecord.id)
    return session.scalars(query).all()


def forget(session: Session, camera_id: str, keep: int, limit: int) -> int:
    """Delete up to `limit` of all but the newest so many, oldest first. Returns how many."""
    surplus = (
        select(EstimateRecord.id)
        .where(EstimateRecord.camera_id == camera_id)
        .order_by(EstimateRecord.id.desc())
        .offset(keep)
        .subquery()
    )
    bite = select(surplus.c.id).order_by(surplus.c.id).limit(limit)
    return delete_some(session, EstimateRecord.id, bite)


def _made_between(
    camera_id: str, start: datetime | None, end: datetime | None
) -> list[ColumnElement[bool]]:
    conditions: list[ColumnElement[bool]] = [EstimateRecord.camera_id == camera_id]
    if start is not None:
        conditions.append(EstimateRecord.created_at >= start)
    if end is not None:
        conditions.append(EstimateRecord.created_at <= end)
    return conditions
