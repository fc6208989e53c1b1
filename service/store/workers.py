"""Worker processes, the job engine's own rows, and the probe that tries to write."""

from collections.abc import Sequence
from datetime import datetime

from sqlalchemy import delete, insert, select, text, update
from sqlalchemy.orm import Mapped, Session, mapped_column

from service.store.cameras import CameraRecord
from service.store.record import Record


class WorkerRecord(Record):
    """A worker process and when it was last heard of.

    `beats` grows with each sign of life: others tell by it, and by no clock, whether it lives.
    `starts` counts its processes. `lost` says that its jobs were given to others. `trouble` is what
    `serve` has to say of one that it cannot keep alive.
    """

    __tablename__ = "workers"

    name: Mapped[str] = mapped_column(primary_key=True)
    pid: Mapped[int]
    started_at: Mapped[datetime]
    heartbeat_at: Mapped[datetime]
    beats: Mapped[int] = mapped_column(default=0)
    starts: Mapped[int] = mapped_column(default=1)
    lost: Mapped[bool] = mapped_column(default=False)
    trouble: Mapped[str | None]


class ProbeRecord(Record):
    """One row, written anew to see whether the store can be written."""

    __tablename__ = "store_probes"

    id: Mapped[int] = mapped_column(primary_key=True)
    written_at: Mapped[datetime]


def add(session: Session, name: str, pid: int, now: datetime) -> WorkerRecord:
    """A new worker."""
    record = WorkerRecord(
        name=name, pid=pid, started_at=now, heartbeat_at=now, beats=0, starts=0, lost=False
    )
    session.add(record)
    return record


def every(session: Session) -> Sequence[WorkerRecord]:
    """All workers, those that are lost among them."""
    return session.scalars(select(WorkerRecord).order_by(WorkerRecord.name)).all()


def forget_lost(session: Session, before: datetime) -> None:
    """Delete workers that were lost and not heard of since a time."""
    session.execute(
        delete(WorkerRecord).where(WorkerRecord.lost, WorkerRecord.heartbeat_at < before)
    )


def write_probe(session: Session, now: datetime) -> None:
    """Write something. Taking the write lock alone succeeds on a full disk."""
    known = update(ProbeRecord).where(ProbeRecord.id == 1).values(written_at=now)
    if not session.execute(known).rowcount:  # type: ignore[attr-defined]
        session.execute(insert(ProbeRecord).values(id=1, written_at=now))


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
