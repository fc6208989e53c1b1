"""News for all event streams of this process: one look at the store for all of them.

No NOTIFY of PostgreSQL's: it has the commits of all who tell wait for one another.
"""

import asyncio
import contextlib
import logging
from collections import deque
from collections.abc import Awaitable, Callable, Sequence

from sqlalchemy.exc import SQLAlchemyError

from service.store.journal import EventRecord

log = logging.getLogger("surefoot.http")

POLL_S = 0.5
_KEPT = 2_000

Newest = Callable[[], Awaitable[int]]
After = Callable[[int], Awaitable[Sequence[EventRecord]]]


class Feed:
    """The newest events, kept for who follows them; in one event loop.

    It looks for more as long as anybody follows, and begins anew with the next one after that.

    Args:
        newest: the id of the newest event.
        after: the events after one, oldest first, as many as are read at once.
    """

    def __init__(self, newest: Newest, after: After) -> None:
        self._newest, self._after = newest, after
        self._kept: deque[EventRecord] = deque()
        self._from = 0
        self._to: int | None = None  # what is kept came after the one, up to the other
        self._followers = 0
        self._looking: asyncio.Task[None] | None = None
        self.news = asyncio.Event()  # that will be set, and replaced, with the next ones

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

    def since(self, seen: int) -> list[EventRecord] | None:
        """Events after one; None where that is longer ago than what is kept."""
        if self._to is None or seen < self._from:
            return None
        return [record for record in self._kept if record.id > seen]

    async def _look(self) -> None:
        while True:
            try:
                if self._to is None:
                    self._from = self._to = await self._newest()
                    self._tell()  # who has read by itself looks once more
                records = await self._after(self._to)
            except SQLAlchemyError as error:
                # Streams have begun; they go on when the store can be read again.
                log.warning("events_not_read", extra={"error": str(error)})
                records = ()
            if records:
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


async def wait(news: asyncio.Event) -> None:
    """Wait for news that were not there when they were asked for, or so long as a look takes."""
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(POLL_S):
            await news.wait()
