"""The database as a file: copies of it, what is wrong in it, and its size."""

import contextlib
import re
import sqlite3
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from sqlalchemy import text
from sqlalchemy.orm import Session

from service.data_dir import make_file

_PAGES_AT_ONCE = 2048
_BUSY_MS = 30_000
_STEPS_A_LOOK = 10_000  # of SQLite, between two looks at the clock
# Triggers of ours do nothing but refuse what would change the log.
_REFUSAL = re.compile(
    r"CREATE TRIGGER \"?\w+\"? BEFORE (UPDATE|DELETE) ON \"?activity\"?"
    r"( WHEN OLD\.at > strftime\([^()]*\))? BEGIN SELECT RAISE\(ABORT, '[^']*'\); END"
)
Progress = Callable[[int, int], None]  # done, total


@contextlib.contextmanager
def connected(path: Path) -> Iterator[sqlite3.Connection]:
    """A plain connection to a database that is there; statements commit by themselves."""
    uri = f"{path.absolute().as_uri()}?mode=rw"
    with contextlib.closing(sqlite3.connect(uri, uri=True, isolation_level=None)) as connection:
        connection.execute(f"PRAGMA busy_timeout={_BUSY_MS}")
        yield connection


def copy(source: Path, target: Path, on_progress: Progress = lambda done, total: None) -> None:
    """Write a database as it is at this moment to another file, while others write to it.

    The target is a new file of this user alone, or a database that is overwritten.
    """
    make_file(target)
    with connected(source) as read, connected(target) as write:
        # One moment: without a transaction, each write of another process would begin it anew.
        read.execute("BEGIN")
        read.execute("SELECT count(*) FROM sqlite_master").fetchone()
        read.backup(
            write,
            pages=_PAGES_AT_ONCE,
            progress=lambda _, left, total: on_progress(total - left, total),
        )
        read.execute("ROLLBACK")
    with connected(target) as write:  # a lone file: no log beside it
        write.execute("PRAGMA wal_checkpoint(TRUNCATE)")


def drop_log(path: Path) -> None:
    """Make a database that nobody uses one lone file, without a log beside it."""
    with connected(path) as connection:
        connection.execute("PRAGMA journal_mode=DELETE")


def revision(path: Path) -> str | None:
    """The schema's revision; None of a database without tables."""
    with connected(path) as connection:
        known = "SELECT count(*) FROM sqlite_master WHERE name = 'alembic_version'"
        if not connection.execute(known).fetchone()[0]:
            return None
        row = connection.execute("SELECT version_num FROM alembic_version").fetchone()
        return None if row is None else str(row[0])


def faults(path: Path) -> list[str]:
    """The faults that SQLite finds in a file; a sound one has none."""
    with connected(path) as connection:
        rows = [str(row[0]) for row in connection.execute("PRAGMA integrity_check(20)")]
    return [] if rows == ["ok"] else rows


def first_fault(path: Path, within_s: float) -> str | None:
    """The first fault that a quick look finds in a file, if any within a time.

    Raises:
        sqlite3.DatabaseError: it cannot be looked through at all.
    """
    end_s = time.monotonic() + within_s
    with connected(path) as connection:
        connection.set_progress_handler(lambda: time.monotonic() > end_s, _STEPS_A_LOOK)
        try:
            found = connection.execute("PRAGMA quick_check(1)").fetchone()[0]
        except sqlite3.OperationalError as error:
            if error.sqlite_errorcode == sqlite3.SQLITE_INTERRUPT:
                return None
            raise
    return None if found == "ok" else str(found)


def broken_references(path: Path) -> dict[str, int]:
    """The number of rows of each table that refer to something that is not there."""
    found: dict[str, int] = {}
    with connected(path) as connection:
        for table, *_ in connection.execute("PRAGMA foreign_key_check"):
            found[str(table)] = found.get(str(table), 0) + 1
    return found


def tables(path: Path) -> set[str]:
    """The names of all tables."""
    with connected(path) as connection:
        rows = connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")
        return {str(row[0]) for row in rows}


def programs(path: Path) -> list[str]:
    """Triggers, views and virtual tables that are none of ours: SQL that runs in our name."""
    with connected(path) as connection:
        rows = connection.execute(
            "SELECT type, name, sql FROM sqlite_master "
            "WHERE type IN ('trigger', 'view') OR sql LIKE 'CREATE VIRTUAL%'"
        ).fetchall()
    return [f"{kind} {name}" for kind, name, sql in rows if not _REFUSAL.fullmatch(sql or "")]


def empty(path: Path, names: Sequence[str]) -> None:
    """Delete all rows of tables, where there are such."""
    with connected(path) as connection:
        connection.execute("BEGIN IMMEDIATE")
        for name in sorted(tables(path).intersection(names)):
            connection.execute(f"DELETE FROM {name}")
        connection.execute("COMMIT")


def drop(path: Path, names: Sequence[str]) -> None:
    """Drop tables, if they exist."""
    with connected(path) as connection:
        connection.execute("BEGIN IMMEDIATE")
        for name in names:
            connection.execute(f"DROP TABLE IF EXISTS {name}")
        connection.execute("COMMIT")


def jobs_but(path: Path, form: str) -> int:
    """The number of the engine's jobs that are not written in a form."""
    if "workflow_status" not in tables(path):
        return 0
    with connected(path) as connection:
        query = "SELECT count(*) FROM workflow_status WHERE serialization <> ?"
        return int(connection.execute(query, (form,)).fetchone()[0])


def weights_of_models(path: Path) -> dict[str, str]:
    """The hash of each model's weights."""
    if "models" not in tables(path):
        return {}
    with connected(path) as connection:
        return dict(connection.execute("SELECT id, weights_sha256 FROM models").fetchall())


def drop_models(path: Path, model_ids: Sequence[str]) -> None:
    """Delete models with what they say of tracks; their cameras are trained anew."""
    with connected(path) as connection:
        connection.execute("PRAGMA foreign_keys=ON")
        connection.executemany("DELETE FROM models WHERE id = ?", [(one,) for one in model_ids])


def sealed_secrets(path: Path) -> list[tuple[str, str]]:
    """The purposes of all secrets, with the sealed secrets: as `keys` seals them."""
    if not {"webhooks", "cameras"} <= tables(path):
        return []
    with connected(path) as connection:
        return connection.execute(
            "SELECT 'webhook ' || id, secret FROM webhooks WHERE secret IS NOT NULL UNION ALL "
            "SELECT 'webhook ' || id, old_secret FROM webhooks WHERE old_secret IS NOT NULL "
            "UNION ALL SELECT 'camera ' || id, snapshot_credentials FROM cameras "
            "WHERE snapshot_credentials IS NOT NULL"
        ).fetchall()


def size(path: Path) -> int:
    """Bytes of a database with its log."""
    both = (path, path.with_name(path.name + "-wal"))
    return sum(one.stat().st_size for one in both if one.exists())


def wipe_log(path: Path, patience_ms: int = _BUSY_MS) -> None:
    """Write the log back and empty it, unless somebody reads all the while."""
    with connected(path) as connection:
        connection.execute(f"PRAGMA busy_timeout={patience_ms}")  # writers wait as long
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()


def overwrite_deleted(session: Session) -> None:
    """Have what this session's connection deletes or changes overwritten with zeros.

    A server keeps what was deleted until it vacuums, and in its logs: so its operator has to know.
    """
    if session.get_bind().dialect.name == "sqlite":
        session.execute(text("PRAGMA secure_delete=ON"))


def free_pages(path: Path) -> int:
    """The number of pages of a file that hold nothing."""
    with connected(path) as connection:
        return int(connection.execute("PRAGMA freelist_count").fetchone()[0])


def give_back(path: Path, pages: int) -> None:
    """Give up to so many free pages back to the disk, in one transaction."""
    with connected(path) as connection:
        # It gives a page a step, without a column; `execute` would take one step alone.
        connection.executescript(f"PRAGMA incremental_vacuum({pages})")
