"""The threads that requests are answered in: made before the first of them, and kept.

The event loop waits for a thread that it starts to run: up to 16 ms where 64 clients keep both
cores busy, and several are started at once after a quiet spell. Nobody is answered meanwhile.
"""

import math
import threading
from functools import partial

import anyio
import anyio.to_thread
from anyio._backends import _asyncio

_SECONDS = 30.0


async def start_threads(number: int) -> None:
    """Start as many as may be at work at once, in this event loop; they end with it."""
    # anyio ends what has been idle for 10 s, and has no setting for it.
    _asyncio.WorkerThread.MAX_IDLE_TIME = math.inf  # type: ignore[assignment]
    anyio.to_thread.current_default_thread_limiter().total_tokens = number
    together = threading.Barrier(number)  # a thread that waits is not given to the next
    async with anyio.create_task_group() as group:
        for _ in range(number):
            group.start_soon(partial(anyio.to_thread.run_sync, together.wait, _SECONDS))
