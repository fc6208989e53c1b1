"""A store on a PostgreSQL server: its connections, and who may write beside whom.

Connections are sessions of the server: locks and settings belong to them, so a pooler in between
has to pool sessions, not transactions.
"""

import hashlib
import logging
import time
from contextlib import AbstractContextManager, nullcontext
from typing import Any

from sqlalchemy import Connection, Engine, event, text
from sqlalchemy.exc import DBAPIError, InvalidatePoolError, SQLAlchemyError

from service.store.engines.pooled import pooled_engine

# The first key of our advisory locks; the second tells what is locked.
LOCKS = 0x5F007


def lock_key(about: str) -> int:
    """A name as an int4 above 0; two names of one key wait for each other, and no more."""
    return int.from_bytes(hashlib.sha256(about.encode()).digest()[:4], "big") % (2**31 - 1) + 1


_ALL = 0  # the second key of the lock of everything
# Together the shared lock of everything and the one of what a transaction is about: others write
# about something else meanwhile, and who writes about everything waits for all of them.
_UPON_ALL = text("SELECT pg_advisory_xact_lock(:locks, :all)")
_UPON_ONE = text(
    "SELECT pg_advisory_xact_lock_shared(:locks, :all), pg_advisory_xact_lock(:locks, :one)"
)
_ALSO = text("SELECT pg_advisory_xact_lock(:locks, :one)")
# A server that is gone is noticed within about ten seconds.
_LIVELINESS = {
    "connect_timeout": 5,
    "keepalives_idle": 5,
    "keepalives_interval": 2,
    "keepalives_count": 3,
    "tcp_user_timeout": 10_000,
    "application_name": "surefoot",
}
# The engine's tables lie in a schema of their own and are asked by their bare names. Our statements
# are small, and to compile them takes longer than to run them. The server, too, has to notice that
# we are gone: our locks go with our connections.
_SETTINGS = """
SELECT set_config('search_path', current_setting('search_path') || ', dbos', false),
       set_config('lock_timeout', %s, false),
       set_config('idle_in_transaction_session_timeout', %s, false),
       set_config('jit', 'off', false),
       set_config('timezone', 'UTC', false),
       set_config('tcp_keepalives_idle', '5', false),
       set_config('tcp_keepalives_interval', '2', false),
       set_config('tcp_keepalives_count', '3', false)
"""
_USED_S, _TRUSTED_S = "surefoot.used_s", 1.0  # when a connection was used last, is as good as now
_IDLE_MS = 60_000  # of a transaction whose process was stopped


class Postgresql:
    """Whoever writes takes locks by what it writes about, at the beginning of its transaction."""

    def __init__(self, url: str, patience_s: float, connections: int) -> None:
        self.engine = postgresql_engine(url, patience_s, connections)
        # Each statement by itself, as on SQLite: without a transaction's begin and end, each of
        # which the server is asked for.
        self.reading: Engine = self.engine.execution_options(isolation_level="AUTOCOMMIT")
        self.connections = connections

    def turn(self) -> AbstractContextManager[None]:
        """No turn is needed: the server has writers wait for one another."""
        return nullcontext()

    def begin(self, connection: Connection, about: str | None) -> None:
        """Wait until nobody else writes about the same, and keep others from it until the end.

        Raises:
            OperationalError: somebody did for longer than the patience lasts.
        """
        values = {"locks": LOCKS, "all": _ALL}
        if about is None:
            connection.execute(_UPON_ALL, values)
        else:
            connection.execute(_UPON_ONE, {**values, "one": lock_key(about)})

    def looking(self) -> AbstractContextManager[None]:
        """None: who writes about one thing keeps nobody from another."""
        return nullcontext()

    def refused(self, error: DBAPIError) -> bool:
        """Never: no connection is only to look."""
        return False

    def lock(self, name: str) -> "ServerLock":
        """A lock that one process of all machines has."""
        return ServerLock(self.engine, name)


def wait_for(connection: Connection, about: str) -> None:
    """Wait until nobody else writes about something, and keep others from it until the end."""
    connection.execute(_ALSO, {"locks": LOCKS, "one": lock_key(about)})


def postgresql_engine(url: str, patience_s: float, connections: int) -> Engine:
    """An engine whose connections are tried before they are used, and wait for locks so long."""
    engine = pooled_engine(url, patience_s, connections, connect_args=_LIVELINESS)

    @event.listens_for(engine, "connect")
    def prepare(connection: Any, _: Any) -> None:
        connection.execute(_SETTINGS, (f"{round(patience_s * 1000)}ms", f"{_IDLE_MS}ms"))
        connection.commit()

    @event.listens_for(engine, "checkin")
    def put_back(connection: Any, record: Any) -> None:
        record.info[_USED_S] = time.monotonic()

    @event.listens_for(engine, "checkout")
    def ping(connection: Any, record: Any, _: Any) -> None:
        # As `pool_pre_ping` does, but not each time: that would be a fifth of what a post asks.
        if time.monotonic() - record.info.get(_USED_S, time.monotonic()) < _TRUSTED_S:
            return
        try:
            engine.dialect.do_ping(connection)
        except engine.dialect.loaded_dbapi.Error as error:
            raise InvalidatePoolError from error  # all of them are tried anew

    return engine


log = logging.getLogger("surefoot.store")

_TAKE = text("SELECT pg_try_advisory_lock(:locks, :one)")
_LOOK_S = 1.0  # between looks at whether the connection lives, and with it the lock


class ServerLock:
    """A lock that the server lets go of when our connection ends, or when it takes us for gone."""

    def __init__(self, engine: Engine, name: str) -> None:
        self._engine = engine
        self._values = {"locks": LOCKS, "one": lock_key(name)}
        self._connection: Connection | None = None
        self._looked_s = 0.0

    def held(self) -> bool:
        """True if it is ours; where it is nobody's, it is taken."""
        try:
            return self._take() if self._connection is None else self._lives(self._connection)
        except SQLAlchemyError as error:
            log.warning("lock_lost", extra={"said": str(error).splitlines()[0]})
            self.close()
            return False

    def close(self) -> None:
        """Let go of it."""
        connection, self._connection = self._connection, None
        if connection is not None:
            # Not back into the pool: the lock would stay with the connection.
            connection.invalidate()
            connection.close()

    def _take(self) -> bool:
        connection = self._engine.connect().execution_options(isolation_level="AUTOCOMMIT")
        if connection.scalar(_TAKE, self._values):
            self._connection, self._looked_s = connection, time.monotonic()
            return True
        connection.close()
        return False

    def _lives(self, connection: Connection) -> bool:
        if time.monotonic() - self._looked_s > _LOOK_S:
            connection.execute(text("SELECT 1"))
            self._looked_s = time.monotonic()
        return True
