"""Statements on tracks that no estimate job has looked at: a lookup a camera."""

from datetime import datetime

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from service.store.tables.cameras import CameraRecord
from service.store.tables.tracks import TrackRecord


def since(session: Session) -> dict[str, tuple[int, datetime]]:
    """The oldest track of each camera that no estimate job has looked at, and when it came."""
    first = (
        select(func.min(TrackRecord.id))
        .where(
            TrackRecord.camera_id == CameraRecord.id,
            TrackRecord.id > func.coalesce(CameraRecord.looked_at_pk, -1),
        )
        .correlate(CameraRecord)
        .scalar_subquery()
    )
    rows = session.execute(
        select(CameraRecord.id, TrackRecord.id, TrackRecord.received_at).join(
            TrackRecord, TrackRecord.id == first
        )
    )
    return {camera_id: (pk, received_at) for camera_id, pk, received_at in rows}
