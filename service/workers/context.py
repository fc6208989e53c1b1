"""The context of every job in a worker process."""

import threading
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field

from service.job_queue import JobQueue
from service.settings import Settings
from service.store.engines.store import Store
from service.training import StepWatch
from service.workers.cooldown import GrowthBudget, GrowthCooldown
from service.workers.running_jobs import RunningJobs


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
    growth_cooldown: GrowthCooldown = field(default_factory=GrowthCooldown)
    growth_budget: GrowthBudget = field(default_factory=GrowthBudget)
    steps: StepWatch = field(default_factory=StepWatch)
    reconciled: RoundRobin = field(default_factory=RoundRobin)
