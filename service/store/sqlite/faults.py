"""What SQLite's errors mean to an operator."""

import contextlib
import sqlite3
from collections.abc import Iterator
from pathlib import Path

from sqlalchemy.exc import DBAPIError

from service.data_dir import StartError

_MEANINGS = {
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
_ELSE = "its folder must be on a writable disk and belong to this user"


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
        if kind not in _MEANINGS:
            raise
        advice = _ADVICE.get(kind, _ELSE)
        raise StartError(f"database: {path} {_MEANINGS[kind]} ({cause}); {advice}") from error
