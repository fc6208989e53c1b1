"""Rhythms of cameras."""

from datetime import datetime
from typing import Any

from sqlalchemy import JSON, ForeignKey, select
from sqlalchemy.orm import Mapped, Session, mapped_column

from service.store.record import Record


class RhythmRecord(Record):
    """The arrival model of a camera: how many people come when, and how late.

    `counts` has the tracks of each hour that they were learned of: it outlives the tracks.
    """

    __tablename__ = "camera_rhythms"

    camera_id: Mapped[str] = mapped_column(
        ForeignKey("cameras.id", ondelete="CASCADE"), primary_key=True
    )
    profile: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))
    counts: Mapped[dict[str, Any]]
    learned_at: Mapped[datetime]


def find(session: Session, camera_id: str) -> RhythmRecord | None:
    """The rhythm of a camera with all that it was learned of; None where none was learned."""
    return session.get(RhythmRecord, camera_id)


def profile(session: Session, camera_id: str) -> dict[str, Any] | None:
    """The profile of a camera alone; None where there is none yet."""
    return session.scalar(select(RhythmRecord.profile).where(RhythmRecord.camera_id == camera_id))


def put(
    session: Session,
    camera_id: str,
    profile: dict[str, Any] | None,
    counts: dict[str, Any],
    now: datetime,
) -> None:
    """Make a rhythm that of a camera."""
    session.merge(RhythmRecord(camera_id=camera_id, profile=profile, counts=counts, learned_at=now))
