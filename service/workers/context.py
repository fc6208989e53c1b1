"""The context of every job in a worker process: running jobs, limits on growth, turns."""

import threading
import time
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

from models.durations import HOUR_S
from service.enums import RunKind
from service.estimation.site_cache import SiteCache
from service.job_queue import JobQueue
from service.reasons import Reasons
from service.settings import Settings
from service.store.engines.store import Store
from service.store.runs import RunTotal
from service.training import StepWatch

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


class RunCounts:
    """Estimation runs of this process by kind, until the next heartbeat stores them."""

    def __init__(self) -> None:
        self._found: dict[RunKind, RunTotal] = {}
        self._lock = threading.Lock()

    def add(self, kind: RunKind, more: RunTotal) -> None:
        """Count runs."""
        with self._lock:
            self._found[kind] = self._found.get(kind, RunTotal()) + more

    def take(self) -> dict[RunKind, RunTotal]:
        """Return the counts and start again at zero."""
        with self._lock:
            found, self._found = self._found, {}
        return found


_SHARE = 0.1  # of a worker's time, where estimates wait for it


class GrowthCooldown:
    """Cameras whose maps do not grow for a while, and why."""

    def __init__(self) -> None:
        self._rests: dict[str, tuple[float, Reasons]] = {}

    def begin(self, camera_id: str, why: Reasons) -> None:
        """Leave a camera's map as it is for an hour."""
        self._rests[camera_id] = (time.monotonic() + HOUR_S, why)

    def failures_of(self, camera_id: str) -> Reasons:
        """The failures for which a camera's map cools down; none where it does not."""
        until_s, why = self._rests.get(camera_id, (0.0, ()))
        if time.monotonic() < until_s:
            return why
        self._rests.pop(camera_id, None)
        return ()


class GrowthBudget:
    """The time that a worker may spend on growth: of hundreds of maps some are always due.

    Where estimates wait, no more than a tenth of it: a map that grows an hour later is no worse.
    """

    def __init__(self) -> None:
        self._free_s = 0.0

    @property
    def spent(self) -> bool:
        """True where so much of the time was spent that estimates go first."""
        return time.monotonic() < self._free_s

    def spend(self, seconds: float) -> None:
        """Note how long a growth took."""
        now_s = time.monotonic()
        self._free_s = max(self._free_s, now_s) + seconds * (1 / _SHARE - 1)


class RoundRobin:
    """Turns that go round; who was added meanwhile has its turn like all others."""

    def __init__(self) -> None:
        self._last = ""

    def take(self, ids: Sequence[str], most: int) -> list[str]:
        """Up to so many of ids, which are in order, from where the last round ended."""
        first = bisect_right(ids, self._last)
        taken = [*ids[first:], *ids[:first]][:most]
        if taken:
            self._last = taken[-1]
        return taken


@dataclass(frozen=True, slots=True, kw_only=True)
class JobContext:
    """The worker's settings, store and queue; `stopping` is set when the process should end."""

    settings: Settings
    store: Store
    queue: JobQueue
    stopping: threading.Event = field(default_factory=threading.Event)
    running: RunningJobs = field(default_factory=RunningJobs)
    runs: RunCounts = field(default_factory=RunCounts)
    growth_cooldown: GrowthCooldown = field(default_factory=GrowthCooldown)
    growth_budget: GrowthBudget = field(default_factory=GrowthBudget)
    steps: StepWatch = field(default_factory=StepWatch)
    reconciled: RoundRobin = field(default_factory=RoundRobin)
    sites: SiteCache = field(default_factory=SiteCache)
