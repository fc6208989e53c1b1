"""One process of all machines at a time: an advisory lock, held as long as a connection."""

import logging
import time

from sqlalchemy import Connection, Engine, text
from sqlalchemy.exc import SQLAlchemyError

from service.store.postgresql.keys import LOCKS, lock_key

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
        """Whether it is ours; where it is nobody's, it is taken."""
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
