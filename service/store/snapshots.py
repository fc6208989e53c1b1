"""Still images of cameras."""

from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import ForeignKey, LargeBinary, String, delete, select
from sqlalchemy.orm import Mapped, Session, mapped_column

from service.store.record import Record


class SnapshotRecord(Record):
    """A still image of a camera, a JPEG, in a row of its own: no other query reads it."""

    __tablename__ = "snapshots"

    camera_id: Mapped[str] = mapped_column(
        ForeignKey("cameras.id", ondelete="CASCADE"), primary_key=True
    )
    jpeg: Mapped[bytes] = mapped_column(LargeBinary)
    sha256: Mapped[str] = mapped_column(String(64))
    width: Mapped[int]
    height: Mapped[int]
    stored_at: Mapped[datetime]


@dataclass(frozen=True, slots=True, kw_only=True)
class SnapshotFacts:
    """Facts of a still image, without reading it."""

    sha256: str
    width: int
    height: int
    stored_at: datetime


def find(session: Session, camera_id: str) -> SnapshotRecord | None:
    """The still image of a camera, or None."""
    return session.get(SnapshotRecord, camera_id)


def facts(session: Session, camera_id: str) -> SnapshotFacts | None:
    """The facts of the still image of a camera, or None."""
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
