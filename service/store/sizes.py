"""Statements on how much space tracks take."""

from sqlalchemy import delete, func, select
from sqlalchemy.orm import Session

from service.store.tables import TrackRecord

_ROW_BYTES = 200  # about what a track takes beside its points and boxes, its indexes included
_SIZE = (
    func.length(TrackRecord.points) + func.coalesce(func.length(TrackRecord.boxes), 0) + _ROW_BYTES
)


def tracks_bytes(session: Session, camera_id: str) -> int:
    """About how many bytes a camera's tracks take."""
    query = select(func.sum(_SIZE)).where(TrackRecord.camera_id == camera_id)
    return session.scalar(query) or 0


def forget_tracks(session: Session, camera_id: str, most_bytes: int, limit: int) -> int:
    """Delete up to so many of the tracks beyond a size, those first that came first; how many."""
    together = func.sum(_SIZE).over(order_by=TrackRecord.id.desc()).label("together")
    sized = select(TrackRecord.id, together).where(TrackRecord.camera_id == camera_id).subquery()
    surplus = (
        select(sized.c.id).where(sized.c.together > most_bytes).order_by(sized.c.id).limit(limit)
    )
    result = session.execute(delete(TrackRecord).where(TrackRecord.id.in_(surplus)))
    return int(result.rowcount)  # type: ignore[attr-defined]
