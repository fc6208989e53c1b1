"""Statements on the job engine's own table, for what its client has no call for."""

from sqlalchemy import text
from sqlalchemy.orm import Session

# Each is answered by an index of the engine.
_DEDUPLICATED = text(
    "SELECT deduplication_id FROM workflow_status "
    "WHERE queue_name = :queue AND deduplication_id IS NOT NULL"
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


def deduplicated(session: Session, queue: str) -> set[str]:
    """The deduplication ids of the jobs of a queue that wait or run."""
    return set(session.scalars(_DEDUPLICATED, {"queue": queue}))


def waits(session: Session, queue: str, key: str) -> bool:
    """Whether a job of a queue's partition waits to start."""
    return session.scalar(_WAITS, {"queue": queue, "key": key}) is not None


def any_waits(session: Session, queue: str, besides: str) -> bool:
    """Whether any job of a queue waits to start, but for one by its deduplication id."""
    return session.scalar(_ANY_WAITS, {"queue": queue, "besides": besides}) is not None


def statuses(session: Session, job_id: str) -> list[str]:
    """The statuses of a job and of those that were queued in its place, `<id>-again-...`."""
    return list(session.scalars(_STATUS, {"id": job_id, "again": f"{job_id}-again-%"}))
