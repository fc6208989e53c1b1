"""Statements on tracks and predictions."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import delete, func, select
from sqlalchemy.dialects.sqlite import insert
from sqlalchemy.orm import Session

from service.store.tables import PredictionRecord, TrackRecord


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackWindow:
    """The newest tracks of a camera by their own times."""

    tracks: int
    from_s: float
    to_s: float
    newest_pk: int
    # The camera's own clock, not ours: what is older than this is outside the window.
    oldest_end_s: float


def add(session: Session, rows: Sequence[dict[str, Any]]) -> int:
    """Insert tracks; one that is already stored stays as it is. Returns how many are new."""
    added = 0
    for row in rows:
        result = session.execute(insert(TrackRecord).values(row).on_conflict_do_nothing())
        added += int(result.rowcount)  # type: ignore[attr-defined]
    return added


def count(session: Session, camera_id: str) -> int:
    """How many tracks are stored."""
    query = select(func.count()).select_from(TrackRecord)
    return session.scalar(query.where(TrackRecord.camera_id == camera_id)) or 0


def newest_end_s(session: Session, camera_id: str) -> float | None:
    """When the newest track ended."""
    return session.scalar(
        select(func.max(TrackRecord.ended_s)).where(TrackRecord.camera_id == camera_id)
    )


def window(session: Session, camera_id: str, tracks: int, days: float) -> TrackWindow | None:
    """The newest so many tracks that ended within so many days of the newest; None without any."""
    newest = newest_end_s(session, camera_id)
    if newest is None:
        return None
    inner = (
        select(TrackRecord.id, TrackRecord.started_s, TrackRecord.ended_s)
        .where(TrackRecord.camera_id == camera_id, TrackRecord.ended_s >= newest - days * 86_400)
        .order_by(TrackRecord.ended_s.desc(), TrackRecord.id.desc())
        .limit(tracks)
        .subquery()
    )
    row = session.execute(
        select(
            func.count(),
            func.min(inner.c.started_s),
            func.max(inner.c.id),
            func.min(inner.c.ended_s),
        ).select_from(inner)
    ).one()
    return TrackWindow(
        tracks=row[0], from_s=row[1], to_s=newest, newest_pk=row[2], oldest_end_s=row[3]
    )


def newest(session: Session, camera_id: str, limit: int) -> Sequence[TrackRecord]:
    """The newest tracks, newest first."""
    return session.scalars(
        select(TrackRecord)
        .where(TrackRecord.camera_id == camera_id)
        .order_by(TrackRecord.ended_s.desc(), TrackRecord.id.desc())
        .limit(limit)
    ).all()


def without_prediction(
    session: Session, camera_id: str, model_id: str, window: TrackWindow, limit: int
) -> Sequence[TrackRecord]:
    """Tracks of the window that the model has not looked at."""
    return session.scalars(
        select(TrackRecord)
        .outerjoin(
            PredictionRecord,
            (PredictionRecord.track_pk == TrackRecord.id) & (PredictionRecord.model_id == model_id),
        )
        .where(
            TrackRecord.camera_id == camera_id,
            TrackRecord.ended_s >= window.oldest_end_s,
            PredictionRecord.track_pk.is_(None),
        )
        .order_by(TrackRecord.ended_s.desc())
        .limit(limit)
    ).all()


def add_predictions(session: Session, rows: Sequence[dict[str, Any]]) -> None:
    """Insert predictions; a second run of the same job changes nothing."""
    if rows:
        session.execute(insert(PredictionRecord).on_conflict_do_nothing(), rows)


def predictions(
    session: Session, camera_id: str, model_id: str, window: TrackWindow
) -> Sequence[PredictionRecord]:
    """What the model says of the window's tracks, of those that gave it something to say."""
    return session.scalars(
        select(PredictionRecord)
        .join(TrackRecord, PredictionRecord.track_pk == TrackRecord.id)
        .where(
            PredictionRecord.model_id == model_id,
            PredictionRecord.windows > 0,
            TrackRecord.camera_id == camera_id,
            TrackRecord.ended_s >= window.oldest_end_s,
        )
        .order_by(TrackRecord.ended_s.desc(), TrackRecord.id.desc())
        .limit(window.tracks)
    ).all()


def forget(session: Session, camera_id: str, before_s: float, keep: int) -> int:
    """Delete tracks that ended before a time, and all but the newest so many. Returns how many."""
    surplus = (
        select(TrackRecord.id)
        .where(TrackRecord.camera_id == camera_id)
        .order_by(TrackRecord.ended_s.desc(), TrackRecord.id.desc())
        .offset(keep)
    )
    result = session.execute(
        delete(TrackRecord).where(
            TrackRecord.camera_id == camera_id,
            (TrackRecord.ended_s < before_s) | TrackRecord.id.in_(surplus),
        )
    )
    return int(result.rowcount)  # type: ignore[attr-defined]


def existing(session: Session, track_pks: Sequence[int]) -> set[int]:
    """Those of the given tracks that are still stored."""
    return set(session.scalars(select(TrackRecord.id).where(TrackRecord.id.in_(track_pks))))
