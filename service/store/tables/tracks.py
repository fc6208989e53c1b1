"""Records of tracks, their sources, and what models say of them."""

from datetime import datetime

from sqlalchemy import ForeignKey, Index, LargeBinary, String, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from service.store.tables.base import camera_key, foreign_key
from service.store.tables.record import Record


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


class PredictionRecord(Record):
    """What a model says of a track; without numbers where the track gives no window."""

    __tablename__ = "predictions"

    model_id: Mapped[str] = foreign_key("models.id", primary_key=True)
    track_pk: Mapped[int] = mapped_column(
        ForeignKey("tracks.id", ondelete="CASCADE"), primary_key=True, index=True
    )
    windows: Mapped[int]
    height_m: Mapped[float | None]
    qw: Mapped[float | None]
    qx: Mapped[float | None]
    qy: Mapped[float | None]
    qz: Mapped[float | None]


class SourceRecord(Record):
    """A name that tracks of a camera came under. Which one counts is the reference's to say.

    `tracks` is how many have been stored, `told_at` when an alert told of it as new.
    """

    __tablename__ = "track_sources"

    camera_id: Mapped[str] = mapped_column(
        ForeignKey("cameras.id", ondelete="CASCADE"), primary_key=True
    )
    name: Mapped[str] = mapped_column(String(200), primary_key=True)
    tracks: Mapped[int]
    first_seen_at: Mapped[datetime]
    last_seen_at: Mapped[datetime]
    told_at: Mapped[datetime | None]
