"""A store in an SQLite file: its connections, and one writer after the other."""

import fcntl
import sqlite3
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, Engine, create_engine, event, make_url, text
from sqlalchemy.exc import DBAPIError, OperationalError

from service.data_dir import make_file
from service.store.engines.prepared import Prepared
from service.store.engines.turns import Turns

_BEGIN = Prepared(text("BEGIN IMMEDIATE"))
# SQLite asks for a lock that others have less and less often, every tenth of a second in the end:
# where several processes write all the time, who has waited long is hardly ever there when it is
# let go of. It is told to give up soon, and asked anew.
_HASTY = Prepared(text("PRAGMA busy_timeout=10"))
_LOOK_ONLY, _LOOK_AND_WRITE = (
    Prepared(text(f"PRAGMA query_only={state}")) for state in ("ON", "OFF")
)
_WAL_BYTES = 64 * 2**20  # what stays of the write-ahead log once it has been written back


class FileLock:
    """A lock that the system lets go of however its holder ends: no clock has a say in it."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("w")
        self._held = False

    def held(self) -> bool:
        """True if it is ours; where it is nobody's, it is taken."""
        if not self._held:
            try:
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                return False
            self._held = True
        return True

    def close(self) -> None:
        """Let go of it."""
        self._file.close()


class Sqlite:
    """The one writer that SQLite allows is also what serialises: no lock is narrower."""

    def __init__(self, url: str, patience_s: float, connections: int) -> None:
        self._path = Path(make_url(url).database or "")
        make_file(self._path)
        self.engine = sqlite_engine(url, patience_s, connections)
        self.reading = self.engine
        self.connections = connections
        self._patience_s = patience_s
        self._patient = Prepared(text(_busy_timeout(patience_s)))
        self._turns = Turns("write")

    def turn(self) -> AbstractContextManager[None]:
        """A turn to write among the threads of this process, in the order of asking.

        Raises:
            OverloadedError: it did not come in time.
        """
        return self._turns.turn(self._patience_s)

    def begin(self, connection: Connection, about: str | None) -> None:
        """Begin a transaction that writes: it holds the write lock from here on.

        Raises:
            OperationalError: other processes had it for longer than the patience lasts.
        """
        until_s = time.monotonic() + self._patience_s
        _HASTY.run(connection)
        try:
            while not _begun(connection, until_s):
                pass
        finally:
            self._patient.run(connection)

    @contextmanager
    def looking(self) -> Iterator[Connection]:
        """A connection that refuses to write: nobody is kept from writing by it."""
        with self.engine.connect() as connection:
            _LOOK_ONLY.run(connection)
            try:
                yield connection
            finally:
                connection.rollback()
                _LOOK_AND_WRITE.run(connection)

    def refused(self, error: DBAPIError) -> bool:
        """True of an error that says that a connection was only to look."""
        return _is(error, sqlite3.SQLITE_READONLY)

    def lock(self, name: str) -> FileLock:
        """A lock that one process of this machine has."""
        return FileLock(self._path.with_name(f"{name}.lock"))


def _begun(connection: Connection, until_s: float) -> bool:
    """True if a transaction has begun; False where others write, and there is time to ask again."""
    try:
        _BEGIN.run(connection)
    except OperationalError as error:
        if not _is(error, sqlite3.SQLITE_BUSY) or time.monotonic() > until_s:
            raise
        return False
    return True


def _is(error: DBAPIError, code: int) -> bool:
    return getattr(error.orig, "sqlite_errorcode", 0) & 0xFF == code


def _busy_timeout(patience_s: float) -> str:
    return f"PRAGMA busy_timeout={round(patience_s * 1000)}"


def sqlite_engine(url: str, patience_s: float, connections: int) -> Engine:
    """An engine of a file in WAL mode with foreign keys on and writers that wait."""
    # All are kept once they were needed: to open one takes six statements, and to close one more.
    # The one that was given back last goes out first, so that few have pages in their caches.
    engine = create_engine(
        url, pool_size=connections, max_overflow=0, pool_timeout=patience_s, pool_use_lifo=True
    )

    @event.listens_for(engine, "connect")
    def prepare(connection: Any, _: Any) -> None:
        _prepare(connection, patience_s)

    return engine


def _prepare(connection: Any, patience_s: float) -> None:
    # The same isolation as the job engine's own connections: reads outside a transaction see the
    # newest commit, the first write takes the write lock at once.
    connection.isolation_level = "IMMEDIATE"
    connection.execute(_busy_timeout(patience_s))
    # Before its first page is written: retention gives pages back to the disk. Asked of a file
    # that has pages, it waits for whoever writes, and readers must not.
    if connection.execute("PRAGMA page_count").fetchone() == (0,):
        connection.execute("PRAGMA auto_vacuum=INCREMENTAL")
    connection.execute("PRAGMA journal_mode=WAL")
    connection.execute(f"PRAGMA journal_size_limit={_WAL_BYTES}")
    connection.execute("PRAGMA synchronous=FULL")  # an answer of 202 survives power loss
    connection.execute("PRAGMA foreign_keys=ON")
