"""Statements on worker processes."""

from collections.abc import Sequence
from datetime import datetime

from sqlalchemy import delete, func, select
from sqlalchemy.orm import Session

from service.store.tables.operation import WorkerRecord


def find(session: Session, name: str) -> WorkerRecord | None:
    """The worker of a name, or None."""
    return session.get(WorkerRecord, name)


def add(session: Session, name: str, pid: int, now: datetime) -> WorkerRecord:
    """A new worker."""
    record = WorkerRecord(
        name=name, pid=pid, started_at=now, heartbeat_at=now, beats=0, starts=0, lost=False
    )
    session.add(record)
    return record


def alive(session: Session) -> Sequence[WorkerRecord]:
    """Workers whose jobs nobody has taken over."""
    return session.scalars(select(WorkerRecord).where(~WorkerRecord.lost)).all()


def newest_heartbeat(session: Session) -> datetime | None:
    """When any worker was last heard of."""
    return session.scalar(select(func.max(WorkerRecord.heartbeat_at)).where(~WorkerRecord.lost))


def after(session: Session, now: datetime) -> Sequence[WorkerRecord]:
    """Workers, lost ones too, that were heard of after a time."""
    return session.scalars(select(WorkerRecord).where(WorkerRecord.heartbeat_at > now)).all()


def troubles(session: Session) -> dict[str, str]:
    """What `serve` has to say of workers that it cannot keep alive, by their names."""
    rows = session.execute(
        select(WorkerRecord.name, WorkerRecord.trouble).where(WorkerRecord.trouble.is_not(None))
    )
    return {name: trouble for name, trouble in rows if trouble is not None}


def forget_lost(session: Session, before: datetime) -> None:
    """Delete workers that were lost and not heard of since a time."""
    session.execute(
        delete(WorkerRecord).where(WorkerRecord.lost, WorkerRecord.heartbeat_at < before)
    )
