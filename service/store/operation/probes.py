"""The statement that tells whether the store can be written."""

from datetime import datetime

from sqlalchemy.dialects.sqlite import insert
from sqlalchemy.orm import Session

from service.store.tables.operation import ProbeRecord


def write(session: Session, now: datetime) -> None:
    """Write something. Taking the write lock alone succeeds on a full disk."""
    row = insert(ProbeRecord).values(id=1, written_at=now)
    session.execute(row.on_conflict_do_update(index_elements=["id"], set_={"written_at": now}))
