"""Statements on rhythms of cameras."""

from datetime import datetime
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from service.store.tables.attendance import RhythmRecord


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
