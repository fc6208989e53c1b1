"""Engine and sessions of the store."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from sqlalchemy import Engine, create_engine, event, text
from sqlalchemy.orm import Session

from service.data_dir import make_private
from service.settings import Settings

_WAL_BYTES = 64 * 2**20  # what stays of the write-ahead log once it has been written back


class Store:
    """The database of one data directory. Nothing connects before the first session."""

    def __init__(self, settings: Settings) -> None:
        make_private(settings.data_dir)
        self.url = settings.database_url
        self.engine = engine_for(self.url)

    @contextmanager
    def read(self) -> Iterator[Session]:
        """A session that only reads."""
        with Session(self.engine) as session:
            yield session

    @contextmanager
    def write(self) -> Iterator[Session]:
        """A session that holds the write lock from its start; commits at the end.

        What it reads is therefore what it writes upon.
        """
        with Session(self.engine, expire_on_commit=False) as session:
            if self.engine.dialect.name == "sqlite":
                session.execute(text("BEGIN IMMEDIATE"))
            yield session
            session.commit()

    def close(self) -> None:
        """Close all connections."""
        self.engine.dispose()


def engine_for(url: str) -> Engine:
    """A SQLAlchemy engine; SQLite in WAL mode with foreign keys on and patient writers."""
    engine = create_engine(url)
    if engine.dialect.name == "sqlite":
        event.listen(engine, "connect", _prepare_sqlite)
    return engine


def _prepare_sqlite(connection: Any, _: Any) -> None:
    # The same isolation as the job engine's own connections: reads outside a transaction see the
    # newest commit, the first write takes the write lock at once.
    connection.isolation_level = "IMMEDIATE"
    connection.execute("PRAGMA busy_timeout=30000")
    # Of a new file only, before its first page is written: retention gives pages back to the disk.
    connection.execute("PRAGMA auto_vacuum=INCREMENTAL")
    connection.execute("PRAGMA journal_mode=WAL")
    connection.execute(f"PRAGMA journal_size_limit={_WAL_BYTES}")
    connection.execute("PRAGMA synchronous=FULL")  # an answer of 202 survives power loss
    connection.execute("PRAGMA foreign_keys=ON")
