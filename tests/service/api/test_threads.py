"""Threads of requests: there before they are needed, and there to stay."""

import asyncio
import threading

import anyio.to_thread
from anyio._backends import _asyncio

from service.api.middleware.admission import start_threads


def pool():
    return {each for each in threading.enumerate() if isinstance(each, _asyncio.WorkerThread)}


async def meet(number):
    """So many at once, who wait for one another."""
    together = threading.Barrier(number)
    each = [anyio.to_thread.run_sync(together.wait, 10) for _ in range(number)]
    await asyncio.gather(*each)


def test_no_request_waits_for_a_thread_to_start(monkeypatch):
    before = pool()

    async def serve():
        await start_threads(6)
        mine = pool() - before
        assert len(mine) == 6
        await meet(6)
        assert pool() - before == mine
        # A night later.
        monkeypatch.setattr(_asyncio.AsyncIOBackend, "current_time", lambda: 1e9)
        await anyio.to_thread.run_sync(int)
        await meet(6)
        assert pool() - before == mine

    asyncio.run(serve())
    for each in pool() - before:
        each.join(10)
    # Threads of earlier tests end when they please.
    assert pool() <= before
