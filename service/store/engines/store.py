"""Sessions of the store, on SQLite or on PostgreSQL."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any, TypeVar

from sqlalchemy import Connection, Engine
from sqlalchemy.exc import DBAPIError
from sqlalchemy.orm import Session

from service.data_dir import make_private
from service.settings import Settings
from service.store.engines.dialects import is_sqlite
from service.store.engines.postgresql import Postgresql, ServerLock, postgresql_engine, wait_for
from service.store.engines.sqlite import FileLock, Sqlite, sqlite_engine

R = TypeVar("R")
Backend = Sqlite | Postgresql
Lock = FileLock | ServerLock

_PATIENCE_S = 30.0  # of workers, who have nobody waiting for an answer
_CONNECTIONS = 15


class Store:
    """The database of one installation. Nothing connects before the first session.

    Args:
        settings: where the data lives.
        patience_s: how long is waited for a connection, for the turn to write and for another
            process's write lock, each.
        connections: how many sessions there may be at once; on PostgreSQL also no more than
            `database_connections`.
    """

    def __init__(
        self,
        settings: Settings,
        patience_s: float = _PATIENCE_S,
        connections: int = _CONNECTIONS,
    ) -> None:
        make_private(settings.data_dir)
        self.url = settings.store_url
        self._backend = _backend_of(settings, patience_s, connections)
        self.engine = self._backend.engine
        self.connections = self._backend.connections

    @contextmanager
    def read(self) -> Iterator[Session]:
        """A session that only reads."""
        with Session(self._backend.reading) as session:
            yield session

    def look(self) -> AbstractContextManager[Connection]:
        """A connection that only reads, for statements that need no session."""
        return self._backend.reading.connect()

    @contextmanager
    def write(self, about: str | None = None) -> Iterator[Session]:
        """A session in which what is read is what is written upon; commits at the end.

        Args:
            about: whose rows these are: a camera's id, or a name with a slash in it. Others may
                write meanwhile about something else, where the database lets them. None: nobody
                else writes.

        Raises:
            OverloadedError: the turn did not come in time.
        """
        with self._backend.turn(), Session(self.engine, expire_on_commit=False) as session:
            self._backend.begin(session.connection(), about)
            yield session
            session.commit()

    def write_if_needed(self, about: str | None, do: Callable[[Session], R]) -> R:
        """The result of something that hardly ever writes: it is tried without keeping anybody out.

        Args:
            about: as of `write`.
            do: where it turns out to write, nothing of it is kept, and it is done again in a
                session of `write`.

        Raises:
            OverloadedError: it writes, and the turn did not come in time.
        """
        with self._backend.looking() as connection:
            if connection is not None:
                try:
                    with joined(connection) as session:
                        return do(session)
                except DBAPIError as error:
                    if not self._backend.refused(error):
                        raise
        with self.write(about) as session:
            return do(session)

    @contextmanager
    def change(self, about: str | None = None) -> Iterator[Connection]:
        """A connection that writes as a session of `write` does, for who needs none.

        Raises:
            OverloadedError: the turn did not come in time.
        """
        with (
            self._backend.turn(),
            self.engine.connect() as connection,
            connection.begin(),  # so that a session that joins does not think it its own
        ):
            self._backend.begin(connection, about)
            yield connection

    def lock(self, name: str) -> Lock:
        """A lock that one process of all that share the store has, as long as it lives."""
        return self._backend.lock(name)

    def close(self) -> None:
        """Close all connections."""
        self.engine.dispose()


@contextmanager
def joined(connection: Connection) -> Iterator[Session]:
    """A session within a connection's transaction, which is not its own to commit."""
    with Session(connection, join_transaction_mode="rollback_only") as session:
        yield session
        session.flush()


def also_about(session: Session, about: str) -> None:
    """Within a transaction that writes about something, write about something else as well."""
    if not is_sqlite(session.get_bind()):
        wait_for(session.connection(), about)


def savepoint(session: Session) -> AbstractContextManager[Any]:
    """A part of a transaction that may be refused without the rest; SQLite needs no mark for it."""
    return nullcontext() if is_sqlite(session.get_bind()) else session.begin_nested()


def engine_for(url: str) -> Engine:
    """An engine for a migration, or a command."""
    if url.startswith("sqlite"):
        return sqlite_engine(url, _PATIENCE_S, _CONNECTIONS)
    return postgresql_engine(url, _PATIENCE_S, _CONNECTIONS)


def _backend_of(settings: Settings, patience_s: float, connections: int) -> Backend:
    if settings.database_url is None:
        return Sqlite(settings.store_url, patience_s, connections)
    most = min(connections, settings.database_connections)
    return Postgresql(settings.store_url, patience_s, most)
