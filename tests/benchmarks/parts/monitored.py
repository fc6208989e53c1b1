"""How long tracks wait until they are monitored, and alerts of knocked cameras, from the store."""

import threading
import time
from bisect import bisect_left
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

from service.store.engines.files import connected

POLL_S = 0.5
_POSTED = "SELECT camera_id, id, received_at FROM tracks WHERE received_at >= ? ORDER BY id"
_ALERTS = (
    "SELECT camera_id, kind, opened_at FROM alerts WHERE opened_at >= ? "
    "AND kind IN ('drift', 'unsure')"
)


def seconds(stored: str) -> float:
    """A stored time in seconds since the epoch."""
    return datetime.fromisoformat(stored).replace(tzinfo=UTC).timestamp()


def stored(at_s: float) -> str:
    """A time in seconds since the epoch as the store has it."""
    return datetime.fromtimestamp(at_s, UTC).strftime("%Y-%m-%d %H:%M:%S.%f")


@dataclass(slots=True)
class Checks:
    """The newest monitored tracks of a camera, in their order, and when each was seen."""

    pks: list[int] = field(default_factory=list)
    seen_s: list[float] = field(default_factory=list)


class CheckWatch(threading.Thread):
    """Polls up to which track each camera was monitored; late by `POLL_S` at most."""

    def __init__(self, database: Path) -> None:
        super().__init__(daemon=True)
        self._database = database
        self._stop_now = threading.Event()
        self.checks: dict[str, Checks] = defaultdict(Checks)

    def run(self) -> None:
        """Poll until stopped."""
        while True:
            stopping = self._stop_now.wait(POLL_S)
            with connected(self._database) as connection:
                rows = connection.execute("SELECT id, read_track_pk FROM cameras").fetchall()
            now_s = time.time()
            for camera_id, pk in rows:
                known = self.checks[camera_id]
                if pk is not None and (not known.pks or pk > known.pks[-1]):
                    known.pks.append(pk)
                    known.seen_s.append(now_s)
            if stopping:
                return

    def stop(self) -> None:
        """Poll once more and stop."""
        self._stop_now.set()
        self.join()


def delays_s(
    database: Path, checks: dict[str, Checks], begun_s: float, ended_s: float, limit_s: float
) -> tuple[list[float], int]:
    """From the arrival of each track to its check, of those that were checked.

    Returns:
        The delays, and how many tracks had waited for longer than the limit without a check at the
        end. Those that had waited for less are in neither.
    """
    with connected(database) as connection:
        posted = connection.execute(_POSTED, (stored(begun_s),)).fetchall()
    delays, overdue = [], 0
    for camera_id, pk, received_at in posted:
        known, at_s = checks[camera_id], seconds(received_at)
        place = bisect_left(known.pks, pk)
        if place < len(known.pks):
            delays.append(known.seen_s[place] - at_s)
        elif ended_s - at_s > limit_s:
            overdue += 1
    return delays, overdue


def count_estimates(database: Path, begun_s: float) -> int:
    """The number of full estimates that were stored from a time on."""
    with connected(database) as connection:
        query = "SELECT count(*) FROM estimates WHERE created_at >= ?"
        return int(connection.execute(query, (stored(begun_s),)).fetchone()[0])


@dataclass(frozen=True, slots=True, kw_only=True)
class KnockAlert:
    """The first alert of a knocked camera about its pose.

    The alert is caused by a track that the run before had not read. `after_cause_s` is from the
    oldest of these tracks to the alert, so it is an upper bound. A run without new tracks counts
    with the run before it. `tracks` were posted from the knock to the alert.
    """

    camera_id: str
    kind: str
    after_knock_s: float
    after_cause_s: float
    tracks: int


def knock_alerts(
    database: Path, checks: dict[str, Checks], knocked: Sequence[str], knocked_s: float
) -> list[KnockAlert]:
    """The first alert of each knocked camera that has one, in the order of the cameras."""
    with connected(database) as connection:
        rows = connection.execute(_ALERTS, (stored(knocked_s),)).fetchall()
        posted = connection.execute(_POSTED, (stored(knocked_s),)).fetchall()
    found = []
    for camera_id in knocked:
        alerts = sorted((seconds(at), kind) for i, kind, at in rows if i == camera_id)
        if not alerts:
            continue
        opened_s, kind = alerts[0]
        known = checks[camera_id]
        came = [(pk, seconds(at)) for i, pk, at in posted if i == camera_id]
        came = [(pk, at_s) for pk, at_s in came if at_s <= opened_s]
        # The run that opened the alert was seen after that; the run before is the one before.
        run = bisect_left(known.seen_s, opened_s)
        new: list[float] = []
        while not new and run > 0:
            run -= 1
            new = [at_s for pk, at_s in came if pk > known.pks[run]]
        found.append(
            KnockAlert(
                camera_id=camera_id,
                kind=kind,
                after_knock_s=round(opened_s - knocked_s, 1),
                after_cause_s=round(opened_s - min(new, default=opened_s), 1),
                tracks=len(came),
            )
        )
    return found
