"""Statements on how much space tracks take."""

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from service.store.database.deleting import delete_some
from service.store.tables.tracks import TrackRecord
from service.store.tracks.counting import bytes_of_track, of_counting_source


def forget_tracks(session: Session, camera_id: str, most_bytes: int, limit: int) -> int:
    """Delete up to `limit` tracks of a camera, the first that came, beyond so many bytes; how many.

    Bytes are those of points, boxes and heads, as `tracks.stored_bytes` counts them; the source
    that counts has as many as all others together.
    """
    size = bytes_of_track()
    together = (
        func.sum(size)
        .over(partition_by=of_counting_source(camera_id), order_by=TrackRecord.id.desc())
        .label("together")
    )
    sized = select(TrackRecord.id, together).where(TrackRecord.camera_id == camera_id).subquery()
    surplus = (
        select(sized.c.id).where(sized.c.together > most_bytes).order_by(sized.c.id).limit(limit)
    )
    return delete_some(session, TrackRecord.id, surplus)
