"""Statements on worker processes."""

from collections.abc import Sequence
from datetime import datetime

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from service.store.tables import WorkerRecord


def beat(session: Session, name: str, pid: int, now: datetime) -> None:
    """Record that a worker is alive."""
    record = session.get(WorkerRecord, name)
    if record is None or record.pid != pid:
        started = WorkerRecord(name=name, pid=pid, started_at=now, heartbeat_at=now)
        session.merge(started)
    else:
        record.heartbeat_at = now


def newest_heartbeat(session: Session) -> datetime | None:
    """When any worker was last heard of."""
    return session.scalar(select(func.max(WorkerRecord.heartbeat_at)))


def silent_since(session: Session, limit: datetime) -> Sequence[WorkerRecord]:
    """Workers that were not heard of after a time."""
    return session.scalars(select(WorkerRecord).where(WorkerRecord.heartbeat_at < limit)).all()
