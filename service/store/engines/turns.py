"""One at a time, in the order of asking: SQLite has one writer, and polls for its lock."""

import threading
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager

from service.errors import OverloadedError


class Turns:
    """A fair lock with bounded waiting; one thread may take a turn and another end it."""

    def __init__(self, what: str) -> None:
        self._what = what
        self._lock = threading.Lock()
        self._taken = False
        self._waiting: deque[threading.Event] = deque()

    @property
    def waiting(self) -> int:
        """The number of those who wait."""
        return len(self._waiting)

    @contextmanager
    def turn(self, patience_s: float) -> Iterator[None]:
        """Wait for one's turn, and have it as long as the block lasts.

        Raises:
            OverloadedError: it did not come in time.
        """
        self._take(patience_s)
        try:
            yield
        finally:
            self._pass_on()

    def _take(self, patience_s: float) -> None:
        with self._lock:
            if not self._taken:
                self._taken = True
                return
            called = threading.Event()
            self._waiting.append(called)
        if called.wait(patience_s):
            return
        with self._lock:
            if called.is_set():  # called in the very moment of giving up
                return
            self._waiting.remove(called)
        raise OverloadedError(
            f"{self._what}: others were at it for {patience_s:g} s", retry_after_s=2
        )

    def _pass_on(self) -> None:
        with self._lock:
            if self._waiting:
                self._waiting.popleft().set()
            else:
                self._taken = False
