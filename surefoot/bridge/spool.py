"""What the bridge has on disk: tracks that wait to be posted, and what open tracks are made of.

A message is acknowledged once it is here. The assemblers' state is saved now and then; what they
were given since then lies beside it, and makes them anew after a crash. All of one step, finished
tracks too, is one transaction.

A file that is damaged, or no database of a bridge, is moved aside, and a new one is begun.
"""

import contextlib
import logging
import sqlite3
import threading
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from types import MappingProxyType

log = logging.getLogger("surefoot.bridge")

MAX_GROUP_TRACKS, MAX_GROUP_BYTES = 200, 1024 * 1024  # of a post
_SAVE_FROM_BYTES = 8 * 1024 * 1024  # of what came since the state was saved
_MOST_SCANNED = 10 * MAX_GROUP_TRACKS  # of a camera's tracks, for those that go in one post
_TABLES = """
CREATE TABLE IF NOT EXISTS posts (
    number INTEGER PRIMARY KEY AUTOINCREMENT, camera TEXT, head BLOB, track BLOB);
CREATE INDEX IF NOT EXISTS posts_of_camera ON posts (camera, number);
CREATE TABLE IF NOT EXISTS given (number INTEGER PRIMARY KEY, at_s REAL, found BLOB);
CREATE TABLE IF NOT EXISTS marks (source TEXT PRIMARY KEY, until_s REAL);
CREATE TABLE IF NOT EXISTS saved (number INTEGER PRIMARY KEY CHECK (number = 0), state BLOB);
CREATE TABLE IF NOT EXISTS under_way (digest BLOB PRIMARY KEY);
CREATE TABLE IF NOT EXISTS suspects (digest BLOB PRIMARY KEY, crashes INTEGER, at_s REAL);
CREATE TABLE IF NOT EXISTS set_aside (
    digest BLOB PRIMARY KEY, at_s REAL, topic TEXT, payload BLOB);
"""
# Read once at the start: a table of another program has other columns.
_COLUMNS = {
    "posts": "number, camera, head, track",
    "given": "number, at_s, found",
    "marks": "source, until_s",
    "saved": "number, state",
    "under_way": "digest",
    "suspects": "digest, crashes, at_s",
    "set_aside": "digest, at_s, topic, payload",
}
# What is wrong with the file itself; all other errors are of the disk, or of another process.
_DAMAGED = {sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_ERROR}


class SpoolError(Exception):
    """The file cannot be used: another bridge has it open, or the disk refuses."""


class _DamagedError(Exception):
    """The file is damaged, or no database of a bridge."""


@dataclass(frozen=True)
class Part:
    """A track to be posted, with the head of its body; without one, a whole body."""

    camera: str
    head: bytes
    track: bytes


@dataclass(frozen=True)
class Group:
    """Parts that go in one post, as they are numbered."""

    camera: str
    head: bytes
    tracks: dict[int, bytes] = field(default_factory=dict)


class Spool:
    """A file of SQLite's that this process alone has; for several threads."""

    def __init__(self, path: Path, max_bytes: int) -> None:
        self._max_bytes = max_bytes
        self._lock = threading.Lock()
        self._news = threading.Condition(self._lock)
        self._last_camera = ""  # posted for last: the next turn is another's
        try:
            try:
                self._db = _opened(path)
            except _DamagedError as error:
                _move_aside(path, str(error))
                self._db = _opened(path)
            self.waiting, self._bytes = self._ask(
                "SELECT count(*), coalesce(sum(length(head) + length(track)), 0) FROM posts"
            )
            (self._given_bytes,) = self._ask("SELECT coalesce(sum(length(found)), 0) FROM given")
        except (sqlite3.Error, _DamagedError, OSError) as error:
            raise SpoolError(f"{path}: {error}; each bridge needs a file of its own") from error
        self.moved_aside = len(list(path.parent.glob(f"{path.name}.damaged-*[0-9Z]")))

    def close(self) -> None:
        """Let another process have the file."""
        with self._lock:
            self._db.close()

    @property
    def full(self) -> bool:
        """True where nothing more is to be kept until something was posted."""
        return self._bytes >= self._max_bytes

    @property
    def wants_state(self) -> bool:
        """True where so much was given that the assemblers' state is to be saved."""
        return self._given_bytes >= _SAVE_FROM_BYTES

    def keep(
        self,
        at_s: float,
        found: bytes | None,
        parts: Sequence[Part],
        state: bytes | None = None,
        marks: Mapping[str, float] = MappingProxyType({}),
    ) -> None:
        """Have all of a step on the disk: what was given and finished, or the state after it.

        `marks` say up to when everybody of a source is kept; they never go back.
        """
        with self._lock, _transaction(self._db):
            if state is not None:
                self._db.execute("REPLACE INTO saved VALUES (0, ?)", (state,))
                self._db.execute("DELETE FROM given")
                self._given_bytes = 0
            elif found is not None:
                self._db.execute("INSERT INTO given (at_s, found) VALUES (?, ?)", (at_s, found))
                self._given_bytes += len(found)
            self._db.executemany(
                "INSERT INTO posts (camera, head, track) VALUES (?, ?, ?)",
                [(part.camera, part.head, part.track) for part in parts],
            )
            self._db.executemany(
                "INSERT INTO marks VALUES (?, ?) ON CONFLICT (source) DO UPDATE "
                "SET until_s = max(until_s, excluded.until_s)",
                list(marks.items()),
            )
            self.waiting += len(parts)
            self._bytes += sum(len(part.head) + len(part.track) for part in parts)
            self._news.notify_all()

    def mark(self, source: str) -> float | None:
        """The time up to which everybody of a source is kept; None where nobody ever was."""
        with self._lock:
            found = self._db.execute("SELECT until_s FROM marks WHERE source = ?", (source,))
            row = found.fetchone()
        return None if row is None else float(row[0])

    def state(self) -> bytes | None:
        """The state that was saved last."""
        found = self._ask("SELECT max(state) FROM saved")[0]
        return None if found is None else bytes(found)

    def given(self) -> list[tuple[float, bytes]]:
        """What was given since then, with its times."""
        with self._lock:
            return self._db.execute("SELECT at_s, found FROM given ORDER BY number").fetchall()

    def wait(self, wait_s: float) -> None:
        """Wait for something to post."""
        with self._news:
            self._news.wait_for(lambda: self.waiting, wait_s)

    def next(self, but: Iterable[int], alone: Iterable[int]) -> Group | None:
        """The tracks of one post. Cameras take turns; of each the oldest go first.

        Numbers in `but` are omitted for now, those in `alone` go in a post by themselves.
        """
        left_out, by_itself = set(but), set(alone)
        with self._lock:
            first = self._first(left_out)
            if first is None:
                return None
            number, self._last_camera, head = first
            if not head or number in by_itself:
                query, left_out = "SELECT number, track FROM posts WHERE number = ?", set()
                alike = self._db.execute(query, (number,))
            else:
                alike = self._db.execute(
                    "SELECT number, track FROM (SELECT number, head, track FROM posts "
                    "WHERE camera = ? AND number >= ? ORDER BY number LIMIT ?) "
                    "WHERE head = ? ORDER BY number LIMIT ?",
                    (self._last_camera, number, _MOST_SCANNED, head, MAX_GROUP_TRACKS),
                )
                left_out |= by_itself
            group = Group(self._last_camera, head)
            size = 0
            for each, track in alike:
                size += len(track)
                if group.tracks and size > MAX_GROUP_BYTES:
                    break
                if each not in left_out:
                    group.tracks[each] = track
            return group

    def _first(self, left_out: set[int]) -> tuple[int, str, bytes] | None:
        """The oldest track of the next camera that has one, after the camera of the last post."""
        after, begun_again = self._last_camera, False
        while True:
            camera: str | None = self._db.execute(
                "SELECT min(camera) FROM posts WHERE camera > ?", (after,)
            ).fetchone()[0]
            if camera is None or (begun_again and camera > self._last_camera):
                if begun_again:
                    return None
                after, begun_again = "", True
                continue
            rows = self._db.execute(
                "SELECT number, camera, head FROM posts WHERE camera = ? ORDER BY number", (camera,)
            )
            first: tuple[int, str, bytes] | None = next(
                (row for row in rows if row[0] not in left_out), None
            )
            rows.close()
            if first is not None:
                return first
            after = camera

    def newest(self) -> int:
        """The number of the track that was kept last; 0 if none waits."""
        return self._ask("SELECT coalesce(max(number), 0) FROM posts")[0]

    def drop_others(self, cameras: Collection[str], until: int) -> Counter[str]:
        """Delete what waits for other cameras, up to a number; return how many tracks of each."""
        with self._lock, _transaction(self._db):
            counts = self._db.execute(
                "SELECT camera, count(*), sum(length(head) + length(track)) FROM posts "
                "WHERE number <= ? GROUP BY camera",
                (until,),
            ).fetchall()
            others = [row for row in counts if row[0] not in cameras]
            self._db.executemany(
                "DELETE FROM posts WHERE camera = ? AND number <= ?",
                [(camera, until) for camera, _, _ in others],
            )
            self.waiting -= sum(count for _, count, _ in others)
            self._bytes -= sum(size for _, _, size in others)
        return Counter({camera: count for camera, count, _ in others})

    @contextlib.contextmanager
    def transaction(self, *, durable: bool) -> Iterator[sqlite3.Connection]:
        """One transaction; unless `durable`, it survives a crash of the process alone."""
        with self._lock:
            if not durable:
                self._db.execute("PRAGMA synchronous = NORMAL")
            try:
                with _transaction(self._db):
                    yield self._db
            finally:
                self._db.execute("PRAGMA synchronous = FULL")

    def drop(self, group: Group) -> None:
        """Forget what was posted, or will never be."""
        with self._lock, _transaction(self._db):
            self._db.executemany(
                "DELETE FROM posts WHERE number = ?", [(number,) for number in group.tracks]
            )
            self.waiting -= len(group.tracks)
            self._bytes -= sum(len(group.head) + len(each) for each in group.tracks.values())

    def _ask(self, query: str) -> tuple[int, ...]:
        with self._lock:
            found: tuple[int, ...] = self._db.execute(query).fetchone()
        return found


@contextlib.contextmanager
def _transaction(db: sqlite3.Connection) -> Iterator[None]:
    db.execute("BEGIN IMMEDIATE")
    try:
        yield
    except BaseException:
        db.execute("ROLLBACK")
        raise
    db.execute("COMMIT")


def _opened(path: Path) -> sqlite3.Connection:
    """A connection to a sound file that this process alone has.

    Raises:
        sqlite3.Error: the disk refuses, or another process has the file.
        _DamagedError: the file is damaged, or no database of a bridge.
    """
    db = sqlite3.connect(path, isolation_level=None, check_same_thread=False, timeout=1.0)
    try:
        for line in ("locking_mode = EXCLUSIVE", "journal_mode = WAL", "synchronous = FULL"):
            db.execute(f"PRAGMA {line}")
        db.executescript(f"BEGIN IMMEDIATE; {_TABLES} COMMIT;")
        for name, columns in _COLUMNS.items():
            db.execute(f"SELECT {columns} FROM {name} LIMIT 1").fetchone()
        found = db.execute("PRAGMA quick_check(1)").fetchone()[0]
        if found != "ok":
            raise _DamagedError(str(found))
    except sqlite3.Error as error:
        db.close()
        if getattr(error, "sqlite_errorcode", 0) & 0xFF in _DAMAGED:
            raise _DamagedError(str(error)) from error
        raise
    except _DamagedError:
        db.close()
        raise
    return db


def _move_aside(path: Path, reason: str) -> None:
    """Rename the file, and what SQLite has put beside it, for a person to look at."""
    to = path.with_name(f"{path.name}.damaged-{datetime.now(UTC):%Y%m%dT%H%M%SZ}")
    for end in ("", "-wal", "-shm", "-journal"):
        beside = path.with_name(path.name + end)
        if beside.exists():
            beside.rename(to.with_name(to.name + end))
    log.error("spool_moved_aside", extra={"path": str(path), "to": str(to), "reason": reason})
