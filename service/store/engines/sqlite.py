"""A store in an SQLite file: connections, one writer after the other, prepared statements."""

import fcntl
import logging
import os
import sqlite3
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

from sqlalchemy import (
    ClauseElement,
    Connection,
    CursorResult,
    Dialect,
    Engine,
    Executable,
    Select,
    event,
    make_url,
    text,
)
from sqlalchemy.dialects.sqlite import pysqlite
from sqlalchemy.exc import DBAPIError, OperationalError
from sqlalchemy.sql.compiler import SQLCompiler

from service.data_dir import make_file
from service.errors import OverloadedError, StoreUnavailableError
from service.store.engines.pooled import pooled_engine

log = logging.getLogger("surefoot.store")


class Turns:
    """A fair lock with bounded waiting; one thread may take a turn and another end it."""

    def __init__(self, what: str) -> None:
        self._what = what
        self._lock = threading.Lock()
        self._taken = False
        self._waiting: deque[threading.Event] = deque()

    @property
    def waiting(self) -> int:
        """The number of those who wait."""
        return len(self._waiting)

    @contextmanager
    def turn(self, patience_s: float) -> Iterator[None]:
        """Wait for one's turn, and have it as long as the block lasts.

        Raises:
            OverloadedError: it did not come in time.
        """
        self._take(patience_s)
        try:
            yield
        finally:
            self._pass_on()

    def _take(self, patience_s: float) -> None:
        with self._lock:
            if not self._taken:
                self._taken = True
                return
            called = threading.Event()
            self._waiting.append(called)
        if called.wait(patience_s):
            return
        with self._lock:
            if called.is_set():  # called in the very moment of giving up
                return
            self._waiting.remove(called)
        raise OverloadedError(
            f"{self._what}: others were at it for {patience_s:g} s", retry_after_s=2
        )

    def _pass_on(self) -> None:
        with self._lock:
            if self._waiting:
                self._waiting.popleft().set()
            else:
                self._taken = False


_DIALECT: Dialect = pysqlite.dialect()

Values = Mapping[str, Any]


class Prepared:
    """A statement of SQLAlchemy's that the driver runs itself, on a connection of SQLAlchemy's.

    Values are converted as SQLAlchemy does, and errors are SQLAlchemy's. Rows come as they are
    stored: columns whose values would have to be converted are not taken.

    `columns` are those that an insert fills.
    """

    def __init__(self, statement: ClauseElement, columns: Sequence[str] | None = None) -> None:
        self._statement = statement
        compiled = statement.compile(dialect=_DIALECT, column_keys=columns)
        assert isinstance(compiled, SQLCompiler)
        self._sql = str(compiled)
        # Of the statement's own, as a limit is; an insert's have no value before they are given.
        self._own = {name: value for name, value in compiled.params.items() if value is not None}
        self._values: list[tuple[str, Callable[[Any], Any] | None]] = [
            (name, compiled.binds[name].type.dialect_impl(_DIALECT).bind_processor(_DIALECT))
            for name in compiled.positiontup or ()
        ]
        if isinstance(statement, Select):
            for column in statement.selected_columns:
                kind = column.type.dialect_impl(_DIALECT)
                assert kind.result_processor(_DIALECT, None) is None, column

    def run(self, connection: Connection) -> None:
        """Run what takes no values and gives no rows."""
        with self._cursor(connection) as cursor:
            cursor.execute(self._sql)

    def row(self, connection: Connection, values: Values) -> tuple[Any, ...] | None:
        """The first row; None where there is none."""
        if connection.dialect.name != _DIALECT.name:
            found = self._executed(connection, values).first()
            return None if found is None else tuple(found)
        with self._cursor(connection) as cursor:
            cursor.execute(self._sql, self._in_order(values))
            row: tuple[Any, ...] | None = cursor.fetchone()
        return row

    def change(self, connection: Connection, *values: Values) -> int:
        """Change what is stored, by each of some values; how many rows that changed."""
        if connection.dialect.name != _DIALECT.name:
            return self._executed(connection, list(values)).rowcount
        with self._cursor(connection) as cursor:
            cursor.executemany(self._sql, [self._in_order(each) for each in values])
        return cursor.rowcount

    def _executed(self, connection: Connection, values: Any) -> CursorResult[Any]:
        assert isinstance(self._statement, Executable)
        return connection.execute(
            self._statement, values, execution_options={"preserve_rowcount": True}
        )

    @contextmanager
    def _cursor(self, connection: Connection) -> Iterator[sqlite3.Cursor]:
        driver: sqlite3.Connection | None = connection.connection.driver_connection
        assert driver is not None
        cursor = driver.cursor()
        try:
            yield cursor
        except sqlite3.Error as error:
            raise DBAPIError.instance(
                self._sql, None, error, sqlite3.Error, hide_parameters=True, dialect=_DIALECT
            ) from error
        finally:
            cursor.close()  # and with it a look at rows that goes on

    def _in_order(self, values: Values) -> list[Any]:
        values = {**self._own, **values} if self._own else values
        return [
            values[name] if convert is None else convert(values[name])
            for name, convert in self._values
        ]


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
        self._opened: tuple[int, int] | None = None  # device and inode of the file in use
        self._replaced = False
        self.engine = sqlite_engine(url, patience_s, connections)
        event.listen(self.engine, "connect", self._note_file)
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
            StoreUnavailableError: the path no longer names the open file.
        """
        self._require_file()
        until_s = time.monotonic() + self._patience_s
        _HASTY.run(connection)
        try:
            while not _begun(connection, until_s):
                pass
        finally:
            self._patient.run(connection)

    @contextmanager
    def looking(self) -> Iterator[Connection]:
        """A connection that refuses to write, so that others can write meanwhile.

        Raises:
            StoreUnavailableError: the path no longer names the open file.
        """
        self._require_file()
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

    def _note_file(self, *_: Any) -> None:
        # The first connection's: a later one may already have opened another file.
        if self._opened is None:
            self._opened = _identity(self._path)

    def _require_file(self) -> None:
        # A deleted file stays open. Writes to it succeed, and are lost when the process ends.
        replaced = self._opened is not None and self._opened != _identity(self._path)
        if replaced and not self._replaced:
            log.error("store_replaced", extra={"path": str(self._path)})
        self._replaced = replaced
        if replaced:
            raise StoreUnavailableError(
                f"store: {self._path} was deleted or replaced while the service was running; put "
                "the file back or restart the service; nothing was stored",
                retry_after_s=10,
            )

    def lock(self, name: str) -> FileLock:
        """A lock that one process of this machine has."""
        return FileLock(self._path.with_name(f"{name}.lock"))


def _identity(path: Path) -> tuple[int, int] | None:
    """Device and inode of the file at a path; None if there is none."""
    try:
        found = os.stat(path)
    except OSError:
        return None
    return found.st_dev, found.st_ino


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
    engine = pooled_engine(url, patience_s, connections)

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
