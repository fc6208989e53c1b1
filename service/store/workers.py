"""Worker processes, and the probe that tells whether the store can be written."""

from collections.abc import Sequence
from datetime import datetime

from sqlalchemy import delete, insert, select, update
from sqlalchemy.orm import Mapped, Session, mapped_column

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


def last_heard(known: Sequence[WorkerRecord]) -> datetime | None:
    """When any of the workers that are not lost was heard of last; None where none ever was."""
    return max((each.heartbeat_at for each in known if not each.lost), default=None)


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
