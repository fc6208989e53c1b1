"""What errors of the database mean to who asked for something."""

import logging

from sqlalchemy.exc import DBAPIError, OperationalError, SQLAlchemyError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError

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
    """Whether a database says so: PostgreSQL by a SQLSTATE, SQLite in words."""
    state = getattr(error.orig, "sqlstate", None)
    return state.startswith(states) if state else any(each in said for each in words)


def _is_cut_off(error: DBAPIError) -> bool:
    """Whether a server is not there, or no longer: what has no SQLSTATE is said by the driver."""
    no_state = getattr(error.orig, "sqlstate", "none") is None
    return error.connection_invalidated or (no_state and isinstance(error, OperationalError))
