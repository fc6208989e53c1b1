"""Statements on still images."""

from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import delete, select
from sqlalchemy.orm import Session

from service.store.tables.cameras import SnapshotRecord


@dataclass(frozen=True, slots=True, kw_only=True)
class SnapshotFacts:
    """What is known of a still image without reading it."""

    sha256: str
    width: int
    height: int
    stored_at: datetime


def find(session: Session, camera_id: str) -> SnapshotRecord | None:
    """The still image of a camera, or None."""
    return session.get(SnapshotRecord, camera_id)


def facts(session: Session, camera_id: str) -> SnapshotFacts | None:
    """What is known of the still image of a camera, or None."""
    row = session.execute(
        select(
            SnapshotRecord.sha256,
            SnapshotRecord.width,
            SnapshotRecord.height,
            SnapshotRecord.stored_at,
        ).where(SnapshotRecord.camera_id == camera_id)
    ).first()
    return None if row is None else SnapshotFacts(**row._mapping)


def put(session: Session, record: SnapshotRecord) -> None:
    """Keep a still image in place of the one there was."""
    session.merge(record)


def remove(session: Session, camera_id: str) -> bool:
    """Delete the still image of a camera; False if there was none."""
    found = delete(SnapshotRecord).where(SnapshotRecord.camera_id == camera_id)
    return bool(session.execute(found).rowcount)  # type: ignore[attr-defined]
