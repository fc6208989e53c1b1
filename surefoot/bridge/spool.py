"""What the bridge has on disk: tracks that wait to be posted, and what open tracks are made of.

A message is acknowledged once it is here. The assemblers' state is saved now and then; what they
were given since then lies beside it, and makes them anew after a crash. All of one step, finished
tracks too, is one transaction.
"""

import contextlib
import sqlite3
import threading
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

MAX_GROUP_TRACKS, MAX_GROUP_BYTES = 200, 1024 * 1024  # of a post
_SAVE_FROM_BYTES = 8 * 1024 * 1024  # of what came since the state was saved
_TABLES = """
CREATE TABLE IF NOT EXISTS posts (
    number INTEGER PRIMARY KEY AUTOINCREMENT, camera TEXT, head BLOB, track BLOB);
CREATE INDEX IF NOT EXISTS posts_alike ON posts (camera, head, number);
CREATE TABLE IF NOT EXISTS given (number INTEGER PRIMARY KEY, at_s REAL, found BLOB);
CREATE TABLE IF NOT EXISTS marks (source TEXT PRIMARY KEY, until_s REAL);
CREATE TABLE IF NOT EXISTS saved (number INTEGER PRIMARY KEY CHECK (number = 0), state BLOB);
"""


class SpoolError(Exception):
    """The file cannot be had: another bridge has it, or it is none of ours."""


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
        try:
            self._db = sqlite3.connect(
                path, isolation_level=None, check_same_thread=False, timeout=1.0
            )
            for line in ("locking_mode = EXCLUSIVE", "journal_mode = WAL", "synchronous = FULL"):
                self._db.execute(f"PRAGMA {line}")
            self._db.executescript(f"BEGIN IMMEDIATE; {_TABLES} COMMIT;")
            self.waiting, self._bytes = self._ask(
                "SELECT count(*), coalesce(sum(length(head) + length(track)), 0) FROM posts"
            )
            (self._given_bytes,) = self._ask("SELECT coalesce(sum(length(found)), 0) FROM given")
        except sqlite3.Error as error:
            raise SpoolError(f"{path}: {error}; each bridge needs a file of its own") from error

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
        """What has waited longest and can go in one post.

        Numbers in `but` are left out for now, those in `alone` go in a post by themselves.
        """
        left_out, by_itself = set(but), set(alone)
        with self._lock:
            rows = self._db.execute("SELECT number, camera, head FROM posts ORDER BY number")
            first = next((row for row in rows if row[0] not in left_out), None)
            rows.close()
            if first is None:
                return None
            number, camera, head = first
            if not head or number in by_itself:
                query, left_out = "SELECT number, track FROM posts WHERE number = ?", set()
                alike = self._db.execute(query, (number,))
            else:
                alike = self._db.execute(
                    "SELECT number, track FROM posts WHERE camera = ? AND head = ? "
                    "AND number >= ? ORDER BY number LIMIT ?",
                    (camera, head, number, MAX_GROUP_TRACKS),
                )
                left_out |= by_itself
            group = Group(camera, head)
            size = 0
            for each, track in alike:
                size += len(track)
                if group.tracks and size > MAX_GROUP_BYTES:
                    break
                if each not in left_out:
                    group.tracks[each] = track
            return group

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
