"""What errors of the database mean to who asked for something."""

import logging

from sqlalchemy.exc import DBAPIError, SQLAlchemyError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError

from service.errors import OverloadedError, ServiceError, StorageFullError, StoreUnavailableError

log = logging.getLogger("surefoot.store")

_FULL = ("disk is full",)
_BUSY = ("database is locked", "database table is locked", "busy")
_GONE = (
    "readonly database", "unable to open", "disk i/o error", "no such table", "malformed",
    "not a database", "locking protocol",
)  # fmt: skip


def failure_of(error: SQLAlchemyError) -> ServiceError | None:
    """The error to answer with; None where the fault is ours and not the disk's or the load's."""
    if isinstance(error, PoolTimeoutError):
        return OverloadedError("store: no connection was free in time", retry_after_s=2)
    if not isinstance(error, DBAPIError):
        return None
    said = str(error.orig).lower()
    if any(words in said for words in _BUSY):
        return OverloadedError("store: another process was writing all the time", retry_after_s=2)
    if any(words in said for words in _FULL):
        log.error("storage_full", extra={"said": said})
        return StorageFullError("store: the disk is full; nothing was stored", retry_after_s=60)
    if any(words in said for words in _GONE):
        log.error("store_unavailable", extra={"said": said})
        return StoreUnavailableError(f"store: {said}; nothing was stored", retry_after_s=10)
    return None
