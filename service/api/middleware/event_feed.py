"""News for all event streams of this process: one look at the store for all of them.

No NOTIFY of PostgreSQL's: it has the commits of all who tell wait for one another.
"""

import asyncio
import contextlib
import logging
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, TypeVar

import anyio
import anyio.to_thread
from sqlalchemy.exc import SQLAlchemyError

from service.api.middleware.admission import STREAM_POLLS
from service.store import journal
from service.store.engines.store import Store
from service.store.journal import EventRecord

Answer = TypeVar("Answer")
log = logging.getLogger("surefoot.http")

POLL_S = 0.5
_KEPT = 2_000
_BATCH = 500


class Feed:
    """The newest events, kept for who follows them; in one event loop.

    It looks for more as long as anybody follows, and begins anew with the next one after that.
    """

    def __init__(self, store: Store) -> None:
        self._store = store
        # All streams together have a few threads, so that they take none from requests.
        self._polls = anyio.CapacityLimiter(STREAM_POLLS)
        self._kept: deque[EventRecord] = deque()
        self._from = 0
        self._to: int | None = None  # what is kept came after the one, up to the other
        self._followers = 0
        self._looking: asyncio.Task[None] | None = None
        self.news = asyncio.Event()  # that will be set, and replaced, with the next ones

    async def ask(self, what: Callable[..., Answer], *args: Any) -> Answer:
        """The answer of what waits for the store, in a thread of the streams'."""
        return await anyio.to_thread.run_sync(partial(what, *args), limiter=self._polls)

    async def newest(self) -> int:
        """The id of the newest event."""
        return await self.ask(self._read, journal.newest_event_id)

    async def after(self, seen: int) -> Sequence[EventRecord]:
        """The stored events after one, oldest first, as many as are read at once."""
        return await self.ask(self._read, journal.events_after, seen, _BATCH)

    async def join(self) -> None:
        """Follow."""
        self._followers += 1
        if self._looking is None:
            self._looking = asyncio.create_task(self._look(), name="feed")

    def leave(self) -> None:
        """Follow no longer."""
        self._followers -= 1
        if not self._followers and self._looking is not None:
            self._looking.cancel()
            self._looking = None
            self._kept.clear()
            self._to = None

    async def since(self, seen: int) -> Sequence[EventRecord]:
        """Events after one: out of what is kept, or of the store where that was long ago."""
        kept = self.kept(seen)
        if kept is not None:
            return kept
        with _going_on():
            return await self.after(seen)
        return ()

    def kept(self, seen: int) -> list[EventRecord] | None:
        """Events after one; None where that is longer ago than what is kept."""
        if self._to is None or seen < self._from:
            return None
        return [record for record in self._kept if record.id > seen]

    async def _look(self) -> None:
        while True:
            with _going_on():
                if self._to is None:
                    self._from = self._to = await self.newest()
                    self._tell()  # who has read by itself looks once more
                if records := await self.after(self._to):
                    self._keep(records)
            await asyncio.sleep(POLL_S)

    def _keep(self, records: Sequence[EventRecord]) -> None:
        self._kept.extend(records)
        self._to = records[-1].id
        while len(self._kept) > _KEPT:
            self._from = self._kept.popleft().id
        self._tell()

    def _tell(self) -> None:
        told, self.news = self.news, asyncio.Event()
        told.set()

    def _read(self, what: Callable[..., Answer], *args: Any) -> Answer:
        with self._store.read() as session:
            return what(session, *args)


@contextlib.contextmanager
def _going_on() -> Iterator[None]:
    """Streams have begun: they go on when the store can be read again."""
    try:
        yield
    except SQLAlchemyError as error:
        log.warning("events_not_read", extra={"error": str(error)})


async def wait(news: asyncio.Event) -> None:
    """Wait for news that were not there when they were asked for, or so long as a look takes."""
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(POLL_S):
            await news.wait()
