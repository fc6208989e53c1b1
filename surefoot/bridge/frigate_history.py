"""Frigate's `/api/events`: whose end no broker has brought, since Frigate publishes with QoS 0.

The spool's mark is the end, by Frigate's clock, up to which everybody is kept. It moves with what
comes by MQTT, but not from a break of the connection on until Frigate was asked about it.
"""

import logging
import threading
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import httpx

from surefoot.bridge.backlog import Backlog
from surefoot.bridge.frigate import (
    MAX_ANSWER_BYTES,
    PERSON,
    CameraOf,
    Stored,
    read_stored,
    track_of,
)
from surefoot.bridge.spool import Part, Spool
from surefoot.bridge.values import MessageError, SkippedRow

log = logging.getLogger("surefoot.bridge")

SOURCE = "frigate"
PAGE = 50  # events of an answer
_MOST_PAGE = 800  # where so many began in one frame
_LONGEST_S = 3600.0 + 60.0  # that the service takes of a track, and what Frigate puts before it
_OVERLAP_S = 60.0  # by which ends may be out of order
_SAME_S = 1e-3
_SETTLE_S = 3.0  # until what ended before we came is in Frigate's database
_WAIT_S = 0.5
_FIRST_S, _LATEST_S = 1.0, 60.0  # between two attempts


class HistoryError(Exception):
    """No answer of Frigate's that can be read, for now."""


@dataclass(kw_only=True)
class History:
    """What is asked of one Frigate; `run` is for a thread of its own, the rest for any."""

    spool: Spool
    camera_of: CameraOf
    _news: threading.Condition = field(default_factory=threading.Condition)
    _gaps: int = 0  # breaks of the connection
    _filled: int = -1  # of these, up to which Frigate was asked
    _wanted: bool = False
    _at: float | None = None  # where the pages go on
    _seen: set[str] = field(default_factory=set)
    _backlog: Backlog = field(default_factory=lambda: Backlog("frigate_waits", "frigate_is_back"))

    def note_connection(self, connected: bool) -> None:
        """Ask Frigate from its last mark on, once the broker brings what is new."""
        with self._news:
            self._gaps += 1
            self._wanted = connected
            self._news.notify()

    def whole(self) -> bool:
        """True while everybody who has ended is kept, or comes by MQTT."""
        return self._filled == self._gaps

    def run(self, url: str, stopping: threading.Event) -> None:
        """Ask the Frigate of a URL after each break, until the event is set."""
        if self.spool.mark(SOURCE) is None:
            self.spool.keep(0.0, None, [], marks={SOURCE: time.time()})
        delay_s = _FIRST_S
        with httpx.Client(base_url=url, timeout=30.0) as http:
            while not stopping.is_set():
                with self._news:
                    self._news.wait_for(lambda: self._wanted, _WAIT_S)
                    wanted, gap = self._wanted, self._gaps
                if not wanted or stopping.wait(_SETTLE_S):
                    continue
                try:
                    self.fill(http, stopping)
                except HistoryError as error:
                    self._backlog.tell(time.time(), url=url, reason=str(error))
                    stopping.wait(delay_s)
                    delay_s = min(2 * delay_s, _LATEST_S)
                    continue
                delay_s = _FIRST_S
                self._backlog.end(time.time())
                with self._news:
                    if gap == self._gaps:
                        self._filled, self._wanted = gap, False

    def fill(self, http: httpx.Client, stopping: threading.Event) -> None:
        """Keep everybody who has ended since the mark, and move it.

        Raises:
            HistoryError: Frigate does not answer; what was kept stays, and the next call goes on.
        """
        mark = self.spool.mark(SOURCE) or time.time()
        if self._at is None:
            self._at, self._seen = mark - _LONGEST_S, set()
        newest, kept, refused = mark, 0, Counter[str]()
        first: str | None = None
        for events in self._pages(http, stopping):
            parts = []
            for event in events:
                if isinstance(event, SkippedRow):
                    refused[event.code] += 1
                    first = first or event.detail
                    continue
                if event.end_time is None or event.end_time < mark - _OVERLAP_S:
                    continue
                newest = max(newest, event.end_time)
                try:
                    track = track_of(event, self.camera_of)
                except MessageError as error:
                    refused[error.code] += 1
                    first = first or f"{event.id}: {error.detail}"
                    continue
                if track is not None:
                    parts.append(Part(track.camera, track.head(SOURCE), track.to_json()))
            kept += len(parts)
            self.spool.keep(0.0, None, parts)
        if stopping.is_set():
            return
        self._at = None
        self.spool.keep(0.0, None, [], marks={SOURCE: min(newest, time.time())})
        log.info("frigate_asked", extra={"kept": kept, "refused": dict(refused), "first": first})

    def _pages(
        self, http: httpx.Client, stopping: threading.Event
    ) -> Iterator[list[Stored | SkippedRow]]:
        """Events by their start, none twice; where many begin in one frame, pages grow."""
        size = PAGE
        while not stopping.is_set():
            if self.spool.full:
                stopping.wait(_WAIT_S)
                continue
            assert self._at is not None
            page = _ask(http, after=self._at - _SAME_S, limit=size)
            known = [event for event in page if isinstance(event, Stored)]
            fresh = [event for event in known if event.id not in self._seen]
            yield [*fresh, *(event for event in page if isinstance(event, SkippedRow))]
            if len(page) < size:
                return
            last = max((event.start_time for event in known), default=self._at)
            ids = {event.id for event in known}
            self._seen = ids if last - self._at > _SAME_S else self._seen | ids
            self._at = last
            if not fresh and (size := 2 * size) > _MOST_PAGE:
                raise HistoryError(f"over {_MOST_PAGE} events that start at {last}")


def _ask(http: httpx.Client, after: float, limit: int) -> list[Stored | SkippedRow]:
    """Ended people that started after a time, the first so many.

    Raises:
        HistoryError: there is no such answer.
    """
    query: dict[str, Any] = {
        "after": after, "sort": "date_asc", "in_progress": 0, "include_thumbnails": 0,
        "labels": PERSON, "limit": limit,
    }  # fmt: skip
    found = bytearray()
    try:
        with http.stream("GET", "/api/events", params=query) as answer:
            if answer.status_code != 200:
                raise HistoryError(f"/api/events answers {answer.status_code}")
            for piece in answer.iter_bytes():
                found += piece
                if len(found) > MAX_ANSWER_BYTES:
                    raise HistoryError(f"/api/events: at most {MAX_ANSWER_BYTES} bytes are taken")
        return read_stored(bytes(found))
    except (httpx.HTTPError, MessageError) as error:
        raise HistoryError(f"{type(error).__name__}: {error}") from error
