"""The job engine's own table, for what its client has no call for."""

from collections.abc import Sequence
from datetime import datetime

from sqlalchemy import select, text
from sqlalchemy.orm import Session

from service.store.cameras import CameraRecord

# Each is answered by an index of the engine.
# Twice a second, of thousands of cameras that are due: told by the database, without their records.
_DUE_WITHOUT = (
    select(CameraRecord.id, CameraRecord.estimate_after)
    .where(
        CameraRecord.estimate_due_at.is_not(None),
        text(
            "NOT EXISTS (SELECT 1 FROM workflow_status "
            "WHERE queue_name = :queue AND deduplication_id = cameras.id)"
        ),
    )
    .order_by(CameraRecord.estimate_due_at, CameraRecord.id)
)
_WAITS = text(
    "SELECT 1 FROM workflow_status WHERE queue_name = :queue AND status = 'ENQUEUED' "
    "AND queue_partition_key = :key LIMIT 1"
)
_ANY_WAITS = text(
    "SELECT 1 FROM workflow_status WHERE queue_name = :queue AND status = 'ENQUEUED' "
    "AND deduplication_id <> :besides LIMIT 1"
)
_STATUS = text(
    "SELECT status FROM workflow_status WHERE workflow_uuid = :id OR workflow_uuid LIKE :again"
)


def due_without(session: Session, queue: str) -> Sequence[tuple[str, datetime | None]]:
    """Cameras that are due and have no job in a queue, the longest due first; and their rests."""
    rows = session.execute(_DUE_WITHOUT, {"queue": queue})
    return [(camera_id, rests_until) for camera_id, rests_until in rows]


def waits(session: Session, queue: str, key: str) -> bool:
    """True if a job of a queue's partition waits to start."""
    return session.scalar(_WAITS, {"queue": queue, "key": key}) is not None


def any_waits(session: Session, queue: str, besides: str) -> bool:
    """True if any job of a queue waits to start, but for one by its deduplication id."""
    return session.scalar(_ANY_WAITS, {"queue": queue, "besides": besides}) is not None


def statuses(session: Session, job_id: str) -> list[str]:
    """The statuses of a job and of those that were queued in its place, `<id>-again-...`."""
    return list(session.scalars(_STATUS, {"id": job_id, "again": f"{job_id}-again-%"}))
