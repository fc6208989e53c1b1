"""The CPU time that a computation may take: who begins it sets it, compiled loops look at it."""

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

# By the monotonic clock, and by the thread's CPU clock, which is slow to ask.
_until_s: ContextVar[tuple[float, float]] = ContextVar("until_s", default=(math.inf, math.inf))


class EffortExceededError(RuntimeError):
    """A computation has taken more CPU time than it may."""


@contextmanager
def limited_effort(cpu_s: float) -> Iterator[None]:
    """Have what this thread computes in the block end once it has taken so many CPU seconds.

    Inside of another limit this one alone counts.
    """
    token = _until_s.set((time.monotonic() + cpu_s, time.thread_time() + cpu_s))
    try:
        yield
    finally:
        _until_s.reset(token)


def check_effort() -> None:
    """Pass silently as long as there is CPU time left.

    Raises:
        EffortExceededError: there is none.
    """
    earliest_s, until_s = _until_s.get()
    # No thread computes for longer than time goes by.
    if time.monotonic() > earliest_s and time.thread_time() > until_s:
        raise EffortExceededError("it takes more CPU time than one look may")
