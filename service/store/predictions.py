"""Predictions of models on tracks."""

from collections.abc import Sequence
from typing import Any

from sqlalchemy import ForeignKey, select
from sqlalchemy.orm import Mapped, Session, mapped_column

from service.store.engines.dialects import new_rows
from service.store.record import Record, foreign_key
from service.store.stored_tracks import StoredTrack, TrackRecord, read, select_tracks
from service.store.windows import WindowBounds, window_ids


class PredictionRecord(Record):
    """A model's prediction on a track; without numbers where the track gives no window."""

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


def without_prediction(
    session: Session, bounds: WindowBounds, model_id: str, limit: int
) -> Sequence[StoredTrack]:
    """Tracks of the window that the model has not looked at, newest first."""
    return read(
        session,
        select_tracks()
        .outerjoin(
            PredictionRecord,
            (PredictionRecord.track_pk == TrackRecord.id) & (PredictionRecord.model_id == model_id),
        )
        .where(
            TrackRecord.id.in_(window_ids(session, bounds)),
            PredictionRecord.track_pk.is_(None),
        )
        .order_by(TrackRecord.ended_s.desc())
        .limit(limit),
    )


def add_predictions(session: Session, rows: Sequence[dict[str, Any]]) -> None:
    """Insert predictions; a second run of the same job changes nothing."""
    if rows:
        session.execute(new_rows(PredictionRecord.__table__), rows)


def predictions(
    session: Session, model_id: str, track_pks: Sequence[int]
) -> Sequence[PredictionRecord]:
    """The model's predictions on some tracks, newest first, of those with a window."""
    return session.scalars(
        select(PredictionRecord)
        .join(TrackRecord, PredictionRecord.track_pk == TrackRecord.id)
        .where(
            PredictionRecord.model_id == model_id,
            PredictionRecord.windows > 0,
            PredictionRecord.track_pk.in_(track_pks),
        )
        .order_by(TrackRecord.ended_s.desc(), TrackRecord.id.desc())
    ).all()
