"""The statement that tells whether the store can be written."""

from datetime import datetime

from sqlalchemy import insert, update
from sqlalchemy.orm import Session

from service.store.tables.operation import ProbeRecord


def write(session: Session, now: datetime) -> None:
    """Write something. Taking the write lock alone succeeds on a full disk."""
    known = update(ProbeRecord).where(ProbeRecord.id == 1).values(written_at=now)
    if not session.execute(known).rowcount:  # type: ignore[attr-defined]
        session.execute(insert(ProbeRecord).values(id=1, written_at=now))
