"""Errors of the databases, as answers to requests and as one line for an operator at a start."""

import contextlib
import logging
import sqlite3
from collections.abc import Iterator
from pathlib import Path

from sqlalchemy import make_url
from sqlalchemy.exc import DBAPIError, OperationalError, SQLAlchemyError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError

from service.data_dir import StartError
from service.errors import OverloadedError, ServiceError, StorageFullError, StoreUnavailableError

log = logging.getLogger("surefoot.store")

_FULL = ("disk is full",)
_BUSY = ("database is locked", "database table is locked", "busy")
_GONE = (
    "readonly database", "unable to open", "disk i/o error", "no such table", "malformed",
    "not a database", "locking protocol",
)  # fmt: skip


# The beginnings of PostgreSQL's: waited in vain, deadlocks, cancelled, too many connections.
_BUSY_STATES = ("55P03", "40", "57014", "53300")
_FULL_STATES = ("53100",)
# Read-only, no connection, being stopped, no such table or database, not let in, out of memory.
_GONE_STATES = ("25006", "08", "57P", "42P01", "3D", "28", "53", "58")


def failure_of(error: SQLAlchemyError) -> ServiceError | None:
    """The error to answer with; None where the fault is ours and not the disk's or the load's."""
    if isinstance(error, PoolTimeoutError):
        return OverloadedError("store: no connection was free in time", retry_after_s=2)
    if not isinstance(error, DBAPIError):
        return None
    said = " ".join(str(error.orig).lower().split())
    if _is(error, said, _BUSY, _BUSY_STATES):
        return OverloadedError("store: another process was writing all the time", retry_after_s=2)
    if _is(error, said, _FULL, _FULL_STATES):
        log.error("storage_full", extra={"said": said})
        return StorageFullError("store: the disk is full; nothing was stored", retry_after_s=60)
    if _is(error, said, _GONE, _GONE_STATES) or _is_cut_off(error):
        log.error("store_unavailable", extra={"said": said})
        return StoreUnavailableError(f"store: {said}; nothing was stored", retry_after_s=10)
    return None


def _is(error: DBAPIError, said: str, words: tuple[str, ...], states: tuple[str, ...]) -> bool:
    """True if a database says so: PostgreSQL by a SQLSTATE, SQLite in words."""
    state = getattr(error.orig, "sqlstate", None)
    return state.startswith(states) if state else any(each in said for each in words)


def _is_cut_off(error: DBAPIError) -> bool:
    """True of a server that is not there, or no longer: the driver's errors have no SQLSTATE."""
    no_state = getattr(error.orig, "sqlstate", "none") is None
    return error.connection_invalidated or (no_state and isinstance(error, OperationalError))


_OF_SQLITE = {
    "SQLITE_NOTADB": "is no SQLite database",
    "SQLITE_CORRUPT": "is damaged",
    "SQLITE_READONLY": "cannot be written",
    "SQLITE_CANTOPEN": "cannot be opened",
    "SQLITE_FULL": "has no space left to grow",
    "SQLITE_IOERR": "cannot be read or written",
    "SQLITE_BUSY": "is locked by another process",
    "SQLITE_PERM": "cannot be opened",
}
_ADVICE = {
    "SQLITE_NOTADB": "put a backup in its place by `surefoot restore`",
    "SQLITE_CORRUPT": "put a backup in its place by `surefoot restore`",
    "SQLITE_FULL": "make room on the disk and start again",
    "SQLITE_BUSY": "stop that one and start again",
}
_ADVICE_ELSE = "its folder must be on a writable disk and belong to this user"


@contextlib.contextmanager
def telling_of_database(path: Path) -> Iterator[None]:
    """Turn what SQLite refuses into one line about the database.

    Raises:
        StartError: the file is damaged, full, locked or not to be opened.
    """
    try:
        yield
    except (DBAPIError, sqlite3.DatabaseError) as error:
        cause = error.orig if isinstance(error, DBAPIError) else error
        name = getattr(cause, "sqlite_errorname", "") or ""
        kind = "_".join(name.split("_")[:2])
        if kind not in _OF_SQLITE:
            raise
        advice = _ADVICE.get(kind, _ADVICE_ELSE)
        raise StartError(f"database: {path} {_OF_SQLITE[kind]} ({cause}); {advice}") from error


# The first of these that a SQLSTATE begins with.
_OF_POSTGRESQL = {
    "28": ("does not let us in", "check user and password in SUREFOOT_DATABASE_URL"),
    "3D": ("is not there", "make it: createdb -E UTF8 NAME"),
    "42501": ("may not be changed by this user", "let it own the database"),
    "25006": ("is read-only", "name the primary in SUREFOOT_DATABASE_URL"),
    "53": ("has no room or no connection left", "see to the server and start again"),
    "57P": ("is starting or stopping", "start again when it runs"),
}


@contextlib.contextmanager
def telling_of_server(url: str) -> Iterator[None]:
    """Turn what a server refuses into one line about the database, without its password.

    Raises:
        StartError: it cannot be reached, or lets us do nothing.
    """
    name = make_url(url).render_as_string(hide_password=True).replace("+psycopg", "")
    try:
        yield
    except DBAPIError as error:
        state = getattr(error.orig, "sqlstate", None) or ""
        said = " ".join(str(error.orig).split())[:300]
        for begins, (meaning, advice) in _OF_POSTGRESQL.items():
            if state.startswith(begins):
                raise StartError(f"database: {name} {meaning} ({said}); {advice}") from error
        if isinstance(error, OperationalError) and (not state or state.startswith("08")):
            raise StartError(
                f"database: {name} cannot be reached ({said}); see to the server and start again"
            ) from error
        raise
