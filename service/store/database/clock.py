"""What time it is for all who share a store."""

from datetime import UTC, datetime

from sqlalchemy import text
from sqlalchemy.orm import Session

from service.store.database.store import is_sqlite

_NOW = text("SELECT clock_timestamp()")


def now_in(session: Session) -> datetime:
    """The time by the clock that all of a store share: this machine's, or the server's."""
    if is_sqlite(session.get_bind()):
        return datetime.now(UTC)
    now: datetime = session.scalars(_NOW).one()
    return now.astimezone(UTC)
