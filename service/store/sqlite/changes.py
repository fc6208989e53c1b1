"""Whether anybody has changed the database: what was read of it holds until then."""

import logging
import sqlite3
from pathlib import Path

log = logging.getLogger("surefoot.store")


class Changes:
    """Tells by a number whether a database is as it was; for one thread.

    The number is SQLite's `data_version` of a connection of its own, which never writes: where it
    is the same twice, nobody, of this process or another, has committed anything in between. It is
    read from memory that all processes share, and waits for nobody.
    """

    def __init__(self, path: Path) -> None:
        self._uri = f"{path.absolute().as_uri()}?mode=rw"
        self._connection: sqlite3.Connection | None = None

    def version(self) -> int | None:
        """The number now; None where it cannot be told."""
        try:
            if self._connection is None:
                self._connection = self._connected()
            # All rows, so that the statement ends, and with it its hold on the log.
            ((version,),) = self._connection.execute("PRAGMA data_version").fetchall()
        except sqlite3.Error as error:
            log.warning("changes_unknown", extra={"said": str(error)})
            return None
        return int(version)

    def close(self) -> None:
        """Close the connection."""
        if self._connection is not None:
            self._connection.close()

    def _connected(self) -> sqlite3.Connection:
        # Once: numbers of different connections say nothing of each other.
        connection = sqlite3.connect(self._uri, uri=True, isolation_level=None, timeout=0)
        connection.execute("PRAGMA query_only=ON")
        return connection
