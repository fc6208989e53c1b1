"""Maintenance windows."""

from collections.abc import Sequence
from datetime import datetime

from sqlalchemy import ForeignKey, Index, String, bindparam, func, select
from sqlalchemy.orm import Mapped, Session, mapped_column

from service.store.record import Record, delete_some


class MaintenanceRecord(Record):
    """A time in which somebody is at a camera: what is seen in it is not judged.

    `to_at` is the plan, `ended_at` when it really ended; None until it has.
    """

    __tablename__ = "maintenance_windows"

    id: Mapped[str] = mapped_column(String(32), primary_key=True)
    camera_id: Mapped[str] = mapped_column(ForeignKey("cameras.id", ondelete="CASCADE"))
    from_at: Mapped[datetime]
    to_at: Mapped[datetime]
    ended_at: Mapped[datetime | None]
    reason: Mapped[str | None]
    requested_by: Mapped[str | None]
    created_at: Mapped[datetime]
    updated_at: Mapped[datetime]

    __table_args__ = (Index(None, "camera_id", "to_at"),)

    @property
    def until(self) -> datetime:
        """The time at which it ended, or will."""
        return self.ended_at or self.to_at

    def holds(self, now: datetime) -> bool:
        """True if somebody is there."""
        return self.from_at <= now < self.until


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
