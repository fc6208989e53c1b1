"""Records beside alerts: what keeps a camera from having any."""

from datetime import datetime
from typing import Any

from sqlalchemy import JSON, ForeignKey, Index, String
from sqlalchemy.orm import Mapped, mapped_column

from service.store.tables.record import Record


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
        """When it ended, or will."""
        return self.ended_at or self.to_at

    def holds(self, now: datetime) -> bool:
        """Whether somebody is there."""
        return self.from_at <= now < self.until


class RhythmRecord(Record):
    """How many people a camera usually sees when, and how late they come (`arrivals`).

    `counts` has the tracks of each hour that they were learned of: it outlives the tracks.
    """

    __tablename__ = "camera_rhythms"

    camera_id: Mapped[str] = mapped_column(
        ForeignKey("cameras.id", ondelete="CASCADE"), primary_key=True
    )
    profile: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))
    counts: Mapped[dict[str, Any]]
    learned_at: Mapped[datetime]
