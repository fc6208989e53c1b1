"""What a worker has in hand and for how long: a job that never ends is told from one that works."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

UPKEEP = "upkeep"  # the kind of the rounds


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """A job, or a round of the upkeep, begun at a time of the monotonic clock."""

    kind: str
    about: tuple[str, ...]
    begun_s: float


@dataclass(slots=True)
class InHand:
    """The tasks of one process. Those without a limit mind their time themselves."""

    limits_s: dict[str, float] = field(default_factory=dict)
    _tasks: dict[int, Task] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    @contextmanager
    def task(self, kind: str, *about: str) -> Iterator[None]:
        """Count a task as in hand as long as the block lasts."""
        task = Task(kind=kind, about=about, begun_s=time.monotonic())
        with self._lock:
            self._tasks[id(task)] = task
        try:
            yield
        finally:
            with self._lock:
                del self._tasks[id(task)]

    def of_kind(self, *kinds: str) -> int:
        """How many tasks of some kinds are in hand."""
        with self._lock:
            return sum(task.kind in kinds for task in self._tasks.values())

    def overdue(self) -> Task | None:
        """A task that has gone on beyond the limit of its kind."""
        now_s = time.monotonic()
        with self._lock:
            for task in self._tasks.values():
                if now_s - task.begun_s > self.limits_s.get(task.kind, float("inf")):
                    return task
        return None
