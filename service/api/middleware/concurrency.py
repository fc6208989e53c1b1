"""Limits of concurrency: so many requests at once, so many waiting, the others come back later.

Kinds of requests have lanes of their own, so that none starves another; `/healthz` needs none.
"""

import asyncio
import math
import threading
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial

import anyio
import anyio.to_thread
from anyio._backends import _asyncio
from starlette.types import Scope

from service.errors import OverloadedError
from service.settings import Settings

_COME_BACK_S = 2.0
_OPERATION_AT_ONCE = 2
STREAM_POLLS = 2  # of all event streams together
LOOKUPS = 4  # of who asks, before a request has its turn
_THREADS_START_S = 30.0  # at the longest


class Lane:
    """Turns for requests of one kind, in the order of their coming; in one event loop."""

    def __init__(self, name: str, *, at_once: int, waiting: int, patience_s: float) -> None:
        self._name = name
        self._free = asyncio.Semaphore(at_once)
        self._most_waiting = waiting
        self._patience_s = patience_s
        self._waiting = 0

    def check(self) -> None:
        """Refuse before anything is read.

        Raises:
            OverloadedError: as many wait already as may.
        """
        if self._free.locked() and self._waiting >= self._most_waiting:
            raise OverloadedError(
                f"{self._name}: every place is taken, and {self._most_waiting} requests wait",
                retry_after_s=_COME_BACK_S,
            )

    @asynccontextmanager
    async def turn(self) -> AsyncIterator[None]:
        """Wait for a turn, and have it as long as the block lasts.

        Raises:
            OverloadedError: too many wait already, or the turn did not come in time.
        """
        self.check()
        self._waiting += 1
        try:
            async with asyncio.timeout(self._patience_s):
                await self._free.acquire()
        except TimeoutError as error:
            raise OverloadedError(
                f"{self._name}: no turn came within {self._patience_s:g} s",
                retry_after_s=_COME_BACK_S,
            ) from error
        finally:
            self._waiting -= 1
        try:
            yield
        finally:
            self._free.release()


class Lanes:
    """The lanes of an application."""

    def __init__(self, settings: Settings) -> None:
        def lane(name: str, at_once: int, waiting: int) -> Lane:
            return Lane(name, at_once=at_once, waiting=waiting, patience_s=settings.http_wait_s)

        self._reads = lane("reads", settings.http_at_once, settings.http_waiting)
        self._writes = lane("writes", settings.http_at_once, settings.http_waiting)
        self._operation = lane("operation", _OPERATION_AT_ONCE, settings.http_waiting)
        self._streams = lane("streams", settings.max_streams, 0)

    def of(self, scope: Scope) -> Lane | None:
        """The lane of a request; None for what is answered whatever the load."""
        path = scope["path"]
        if path == "/healthz":
            return None
        if path in ("/readyz", "/metrics"):
            return self._operation
        if path == "/events":
            return self._streams
        return self._reads if scope["method"] in ("GET", "HEAD") else self._writes


def sessions_at_once(settings: Settings) -> int:
    """The most sessions that requests have at once: a request has one at a time."""
    return 2 * settings.http_at_once + _OPERATION_AT_ONCE + STREAM_POLLS + LOOKUPS


async def start_threads(number: int) -> None:
    """Start as many threads as may answer at once, in this event loop; they end with it.

    The loop waits for a thread that it starts to run, up to 16 ms where 64 clients keep two cores
    busy, and nobody is answered meanwhile: so all are made before the first request, and kept.
    """
    # anyio ends what has been idle for 10 s, and has no setting for it.
    _asyncio.WorkerThread.MAX_IDLE_TIME = math.inf  # type: ignore[assignment]
    anyio.to_thread.current_default_thread_limiter().total_tokens = number
    together = threading.Barrier(number)  # a thread that waits is not given to the next
    async with anyio.create_task_group() as group:
        for _ in range(number):
            group.start_soon(partial(anyio.to_thread.run_sync, together.wait, _THREADS_START_S))
