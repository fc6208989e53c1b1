"""A store in an SQLite file: its connections, and one writer after the other."""

from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, Engine, create_engine, event, make_url, text

from service.data_dir import make_file
from service.store.sqlite.changes import Changes
from service.store.sqlite.file_lock import FileLock
from service.store.sqlite.prepared import Prepared
from service.store.sqlite.turns import Turns

_BEGIN = Prepared(text("BEGIN IMMEDIATE"))
_WAL_BYTES = 64 * 2**20  # what stays of the write-ahead log once it has been written back


class Sqlite:
    """The one writer that SQLite allows is also what serialises: no lock is narrower."""

    def __init__(self, url: str, patience_s: float, connections: int) -> None:
        self._path = Path(make_url(url).database or "")
        make_file(self._path)
        self.engine = sqlite_engine(url, patience_s, connections)
        self.reading = self.engine
        self.connections = connections
        self._patience_s = patience_s
        self._turns = Turns("write")

    def turn(self) -> AbstractContextManager[None]:
        """A turn to write among the threads of this process, in the order of asking.

        Raises:
            OverloadedError: it did not come in time.
        """
        return self._turns.turn(self._patience_s)

    def begin(self, connection: Connection, about: str | None) -> None:
        """Begin a transaction that writes: it holds the write lock from here on."""
        _BEGIN.run(connection)

    def changes(self) -> Changes:
        """What tells whether anybody has changed the store."""
        return Changes(self._path)

    def lock(self, name: str) -> FileLock:
        """A lock that one process of this machine has."""
        return FileLock(self._path.with_name(f"{name}.lock"))


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
    connection.execute(f"PRAGMA busy_timeout={round(patience_s * 1000)}")
    # Before its first page is written: retention gives pages back to the disk. Asked of a file
    # that has pages, it waits for whoever writes, and readers must not.
    if connection.execute("PRAGMA page_count").fetchone() == (0,):
        connection.execute("PRAGMA auto_vacuum=INCREMENTAL")
    connection.execute("PRAGMA journal_mode=WAL")
    connection.execute(f"PRAGMA journal_size_limit={_WAL_BYTES}")
    connection.execute("PRAGMA synchronous=FULL")  # an answer of 202 survives power loss
    connection.execute("PRAGMA foreign_keys=ON")
