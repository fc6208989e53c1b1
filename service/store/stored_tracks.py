"""Stored tracks, and which of them count: those of the source that the reference is of."""

from collections.abc import Sequence
from datetime import datetime
from typing import Any, NamedTuple

from sqlalchemy import (
    BindParameter,
    ColumnElement,
    Index,
    LargeBinary,
    Select,
    UniqueConstraint,
    func,
    select,
)
from sqlalchemy.orm import InstrumentedAttribute, Mapped, Session, mapped_column

from service.store.record import Record, camera_key
from service.store.references import CameraId, counting_source


class TrackRecord(Record):
    """A stored track: points (N, 3), boxes (N, 4) and heads (N, 2) as little-endian float64."""

    __tablename__ = "tracks"

    id: Mapped[int] = mapped_column(primary_key=True)
    camera_id: Mapped[str] = camera_key()
    source: Mapped[str]
    track_id: Mapped[str]
    started_s: Mapped[float]
    ended_s: Mapped[float]
    points: Mapped[bytes] = mapped_column(LargeBinary)
    boxes: Mapped[bytes | None] = mapped_column(LargeBinary)
    heads: Mapped[bytes | None] = mapped_column(LargeBinary)
    received_at: Mapped[datetime]

    __table_args__ = (
        UniqueConstraint("camera_id", "source", "track_id", "started_s"),
        Index(None, "camera_id", "ended_s", "source"),
        Index(None, "camera_id", "id"),
        # What counts is counted without its points; when it came is the camera's rhythm.
        Index(None, "camera_id", "received_at", "ended_s", "source"),
    )


class StoredTrack(NamedTuple):
    """The columns of a `TrackRecord` that estimates need."""

    id: int
    track_id: str
    started_s: float
    ended_s: float
    points: bytes
    boxes: bytes | None
    heads: bytes | None
    received_at: datetime


_COLUMNS = [getattr(TrackRecord, name) for name in StoredTrack._fields]


def select_tracks() -> Select[Any]:
    """A statement whose rows `read` takes."""
    return select(*_COLUMNS)


def read(session: Session, statement: Select[Any]) -> Sequence[StoredTrack]:
    """The tracks that a statement finds."""
    return [StoredTrack._make(row) for row in session.execute(statement)]


Spans = tuple[tuple[float, float], ...]  # times, from and to


def bytes_of_track() -> ColumnElement[int]:
    """The bytes of a track's points, boxes and heads."""
    return (
        func.length(TrackRecord.points)
        + func.coalesce(func.length(TrackRecord.boxes), 0)
        + func.coalesce(func.length(TrackRecord.heads), 0)
    )


def of_counting_source(camera_id: CameraId) -> ColumnElement[bool]:
    """The condition that a track is of the source that counts; all are, as long as none does."""
    counting = counting_source(camera_id).scalar_subquery()
    return TrackRecord.source == func.coalesce(counting, TrackRecord.source)


def counting(camera_id: str | BindParameter[str]) -> list[ColumnElement[bool]]:
    """The conditions that a track is of a camera, and of the source that counts."""
    return [TrackRecord.camera_id == camera_id, of_counting_source(camera_id)]


def newest_source_of(camera_id: str | InstrumentedAttribute[str]) -> Select[str]:
    """The source that counts; where none does, that of the newest track."""
    newest = (
        select(TrackRecord.source)
        .where(TrackRecord.camera_id == camera_id)
        .order_by(TrackRecord.ended_s.desc(), TrackRecord.id.desc())
        .limit(1)
    )
    if not isinstance(camera_id, str):
        newest = newest.correlate(camera_id.class_)
    return select(
        func.coalesce(counting_source(camera_id).scalar_subquery(), newest.scalar_subquery())
    )


def started_from(camera_id: str, started_from_s: float | None) -> list[ColumnElement[bool]]:
    """The conditions that a track counts and started at or after a time."""
    conditions = counting(camera_id)
    if started_from_s is not None:
        conditions.append(TrackRecord.started_s >= started_from_s)
    return conditions


def outside(spans: Spans) -> list[ColumnElement[bool]]:
    """The conditions that tracks were seen at none of some times."""
    return [
        (TrackRecord.ended_s < from_s) | (TrackRecord.started_s > to_s) for from_s, to_s in spans
    ]
