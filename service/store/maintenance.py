"""Statements on maintenance windows."""

from collections.abc import Sequence
from datetime import datetime

from sqlalchemy import bindparam, func, select
from sqlalchemy.orm import Session

from service.store.database.deleting import delete_some
from service.store.tables.attendance import MaintenanceRecord

_UNTIL = func.coalesce(MaintenanceRecord.ended_at, MaintenanceRecord.to_at)

# Built once: each reconcile of a camera asks for it.
_JUST_OVER = select(MaintenanceRecord).where(
    MaintenanceRecord.camera_id == bindparam("camera"),
    MaintenanceRecord.to_at <= bindparam("now"),
    MaintenanceRecord.ended_at.is_(None),
)


def find(session: Session, camera_id: str, window_id: str) -> MaintenanceRecord | None:
    """The window of a camera, or None."""
    record = session.get(MaintenanceRecord, window_id)
    return record if record is not None and record.camera_id == camera_id else None


def of_camera(session: Session, camera_id: str) -> Sequence[MaintenanceRecord]:
    """A camera's windows in the order of their beginnings."""
    return session.scalars(
        select(MaintenanceRecord)
        .where(MaintenanceRecord.camera_id == camera_id)
        .order_by(MaintenanceRecord.from_at, MaintenanceRecord.id)
    ).all()


def under_way(session: Session, camera_id: str, now: datetime) -> MaintenanceRecord | None:
    """The window that a camera is in, of several the one that ends last; None out of any."""
    return session.scalars(
        select(MaintenanceRecord)
        .where(
            MaintenanceRecord.camera_id == camera_id,
            now < _UNTIL,
            MaintenanceRecord.from_at <= now,
        )
        .order_by(_UNTIL.desc())
        .limit(1)
    ).first()


def just_over(session: Session, camera_id: str, now: datetime) -> Sequence[MaintenanceRecord]:
    """Windows that have come to their planned end, which nobody has noted yet."""
    return session.scalars(_JUST_OVER, {"camera": camera_id, "now": now}).all()


def forget(session: Session, camera_id: str, before: datetime, limit: int) -> int:
    """Delete up to `limit` of the windows that ended before a time. Returns how many."""
    bite = (
        select(MaintenanceRecord.id)
        .where(MaintenanceRecord.camera_id == camera_id, before > _UNTIL)
        .limit(limit)
    )
    return delete_some(session, MaintenanceRecord.id, bite)
