"""The running jobs of a worker: one that never ends is told from one that works."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

UPKEEP = "upkeep"  # the kind of periodic work


@dataclass(frozen=True, slots=True, kw_only=True)
class RunningJob:
    """A job, or a step of periodic work, begun at a time of the monotonic clock."""

    kind: str
    about: tuple[str, ...]
    begun_s: float


@dataclass(slots=True)
class RunningJobs:
    """Those of one process. Those without a limit mind their time themselves."""

    limits_s: dict[str, float] = field(default_factory=dict)
    _jobs: dict[int, RunningJob] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    @contextmanager
    def job(self, kind: str, *about: str) -> Iterator[None]:
        """Count a job as running as long as the block lasts."""
        job = RunningJob(kind=kind, about=about, begun_s=time.monotonic())
        with self._lock:
            self._jobs[id(job)] = job
        try:
            yield
        finally:
            with self._lock:
                del self._jobs[id(job)]

    def of_kind(self, *kinds: str) -> int:
        """The number of running jobs of some kinds."""
        with self._lock:
            return sum(job.kind in kinds for job in self._jobs.values())

    def overdue(self) -> RunningJob | None:
        """A job that has gone on beyond the limit of its kind."""
        now_s = time.monotonic()
        with self._lock:
            for job in self._jobs.values():
                if now_s - job.begun_s > self.limits_s.get(job.kind, float("inf")):
                    return job
        return None
