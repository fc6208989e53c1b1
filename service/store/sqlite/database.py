"""Engine and sessions of the store."""

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any

from sqlalchemy import Connection, Engine, create_engine, event, text
from sqlalchemy.orm import Session

from service.data_dir import make_private
from service.settings import Settings
from service.store.sqlite.prepared import Prepared
from service.store.sqlite.turns import Turns

_PATIENCE_S = 30.0  # of workers, who have nobody waiting for an answer
_CONNECTIONS = 15

_BEGIN = Prepared(text("BEGIN IMMEDIATE"))
_WAL_BYTES = 64 * 2**20  # what stays of the write-ahead log once it has been written back


class Store:
    """The database of one data directory. Nothing connects before the first session.

    Args:
        settings: where the data lives.
        patience_s: how long is waited for a connection, for the turn to write and for another
            process's write lock, each.
        connections: how many sessions there may be at once.
    """

    def __init__(
        self,
        settings: Settings,
        patience_s: float = _PATIENCE_S,
        connections: int = _CONNECTIONS,
    ) -> None:
        make_private(settings.data_dir)
        self.url = settings.database_url
        self.engine = engine_for(self.url, patience_s, connections)
        self.connections = connections
        self._patience_s = patience_s
        self._turns = Turns("write")

    @contextmanager
    def read(self) -> Iterator[Session]:
        """A session that only reads."""
        with Session(self.engine) as session:
            yield session

    def look(self) -> AbstractContextManager[Connection]:
        """A connection that only reads, for statements that need no session."""
        return self.engine.connect()

    @contextmanager
    def write(self) -> Iterator[Session]:
        """A session that holds the write lock from its start; commits at the end.

        What it reads is therefore what it writes upon. Threads of this process have their turns in
        the order of asking.

        Raises:
            OverloadedError: the turn did not come in time.
        """
        if self.engine.dialect.name != "sqlite":
            with Session(self.engine, expire_on_commit=False) as session:
                yield session
                session.commit()
            return
        with (
            self._turns.turn(self._patience_s),
            Session(self.engine, expire_on_commit=False) as session,
        ):
            _BEGIN.run(session.connection())
            yield session
            session.commit()

    @contextmanager
    def change(self) -> Iterator[Connection]:
        """A connection that writes as a session of `write` does, for who needs none.

        Raises:
            OverloadedError: the turn did not come in time.
        """
        with (
            self._turns.turn(self._patience_s),
            self.engine.connect() as connection,
            connection.begin(),  # so that a session that joins does not think it its own
        ):
            _BEGIN.run(connection)
            yield connection

    def close(self) -> None:
        """Close all connections."""
        self.engine.dispose()


@contextmanager
def joined(connection: Connection) -> Iterator[Session]:
    """A session within a connection's transaction, which is not its own to commit."""
    with Session(connection, join_transaction_mode="rollback_only") as session:
        yield session
        session.flush()


def engine_for(
    url: str, patience_s: float = _PATIENCE_S, connections: int = _CONNECTIONS
) -> Engine:
    """A SQLAlchemy engine; SQLite in WAL mode with foreign keys on and writers that wait."""
    # All are kept once they were needed: to open one takes six statements, and to close one more.
    # The one that was given back last goes out first, so that few have pages in their caches.
    engine = create_engine(
        url, pool_size=connections, max_overflow=0, pool_timeout=patience_s, pool_use_lifo=True
    )
    if engine.dialect.name == "sqlite":

        @event.listens_for(engine, "connect")
        def prepare(connection: Any, _: Any) -> None:
            _prepare_sqlite(connection, patience_s)

    return engine


def _prepare_sqlite(connection: Any, patience_s: float) -> None:
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
