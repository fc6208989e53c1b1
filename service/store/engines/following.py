"""Reading on from the last id that was seen, without missing what is committed late.

On SQLite one writes after the other, and ids are given in the order of commits. On PostgreSQL a row
may get an id, and be committed after one with a larger id has been read. Whoever adds rows says so
by a lock before, in whose key is the last id that was given by then: as long as it is held, up to
the end of the transaction, nobody reads beyond that id. No one ever waits for these locks.
"""

from typing import Any

from sqlalchemy import ColumnElement, TextClause, func, select, text
from sqlalchemy.orm import Session

from service.store.engines.dialects import is_sqlite

# Above the 48 bits of an id in the key of a lock; for each table its own.
_PREFIXES = {"events": 0x5F07, "activity": 0x5F08}
_GIVEN = "SELECT CASE WHEN is_called THEN last_value ELSE 0 END FROM {table}_id_seq"
_MARK = (
    "SELECT pg_advisory_xact_lock_shared((CAST({prefix} AS bigint) << 48) "
    "| CASE WHEN is_called THEN last_value ELSE 0 END) FROM {table}_id_seq"
)
_MARKED = (
    "SELECT min(((CAST(classid AS bigint) & 65535) << 32) | CAST(objid AS bigint)) FROM pg_locks "
    "WHERE locktype = 'advisory' AND objsubid = 1 AND CAST(classid AS bigint) >> 16 = {prefix} "
    "AND database = (SELECT oid FROM pg_database WHERE datname = current_database())"
)


def mark_entry(session: Session, record: Any) -> None:
    """Say that rows are about to be added to a table that is followed."""
    if not is_sqlite(session.get_bind()):
        session.execute(_said(_MARK, record))


def settled(session: Session, record: Any) -> list[ColumnElement[bool]]:
    """The condition that nothing will come before a row any more; SQLite's rows are all so."""
    if is_sqlite(session.get_bind()):
        return []
    return [record.id <= _horizon(session, record)]


def newest_settled(session: Session, record: Any) -> int:
    """The largest id of a table that nothing will come before any more; 0 without any."""
    if is_sqlite(session.get_bind()):
        return session.scalar(select(func.max(record.id))) or 0
    return _horizon(session, record)


def _horizon(session: Session, record: Any) -> int:
    # In this order: who marks itself after the second look is given an id after the first one.
    given = int(session.scalars(_said(_GIVEN, record)).one())
    marked = session.scalars(_said(_MARKED, record)).one()
    return given if marked is None else min(given, int(marked))


def _said(statement: str, record: Any) -> TextClause:
    table = record.__tablename__
    return text(statement.format(table=table, prefix=_PREFIXES[table]))
