"""The periodic work of the workers: one of them does it, by the monotonic clock.

Which one is told by a lock, that is let go of however its holder ends: no clock has a say in it.
What is done each hour has a thread of its own: it may take minutes, and alerts and deliveries do
not wait for it.
"""

import logging
import threading
import time
from collections.abc import Callable
from contextlib import closing, nullcontext
from dataclasses import dataclass

from service.alerts.staleness import StaleWatch
from service.data_dir import ROUNDS
from service.store.engines.store import Lock
from service.workers import engine
from service.workers.context import JobContext
from service.workers.in_hand import UPKEEP
from service.workers.upkeep.arrival_rates import run_rhythms
from service.workers.upkeep.housekeeping import ClockWatch, run_reconcile, run_sweep
from service.workers.upkeep.retention import run_retention

log = logging.getLogger("surefoot.worker")

_SHORTEST_REST_S, _ASK_S = 0.05, 1.0
_SWEEP_S = 0.5
_CLOCK_S = 1.0
_HOUR_S = 3600.0
_FIRST_HOURLY_S = 120.0  # a service that is restarted every half an hour has its turn too


@dataclass(slots=True)
class Round:
    """Something to do every so often; what fails is logged, and done again at its next time.

    One in `steps` counts each of its steps as in hand, since all together have no limit.
    """

    name: str
    every_s: float
    do: Callable[[], object]
    due_s: float
    steps: bool = False

    def do_if_due(self, context: JobContext) -> None:
        """Do it, if its time has come."""
        if time.monotonic() < self.due_s:
            return
        try:
            with nullcontext() if self.steps else context.in_hand.task(UPKEEP, self.name):
                self.do()
        except Exception:
            log.exception("round_failed", extra={"round": self.name})
        self.due_s = time.monotonic() + self.every_s


def start_rounds(context: JobContext) -> None:
    """Do the rounds in a thread, as soon as no other worker does."""
    threading.Thread(target=_go, args=(context,), name="rounds", daemon=True).start()


def _go(context: JobContext) -> None:
    with closing(context.store.lock(ROUNDS)) as lock:
        while not context.stopping.is_set():
            if lock.held():
                _go_round(context, lock)
            context.stopping.wait(_ASK_S)


def _go_round(context: JobContext, lock: Lock) -> None:
    """Do the rounds until the process is to end, or the lock is another's."""
    log.info("rounds_taken")
    now_s, over = time.monotonic(), threading.Event()
    hourly = threading.Thread(
        target=_repeat,
        args=(context, _hourly(context, now_s), lambda: not over.is_set()),
        name="hourly",
        daemon=True,
    )
    hourly.start()
    _repeat(context, _quick(context, now_s), lock.held)
    over.set()
    hourly.join()  # the lock is held until nobody does a round


def _repeat(context: JobContext, rounds: list[Round], goes_on: Callable[[], bool]) -> None:
    rest_s = 0.0
    while not context.stopping.wait(rest_s) and goes_on():
        for each in rounds:
            each.do_if_due(context)
        due_s = min(each.due_s for each in rounds) - time.monotonic()
        rest_s = max(min(due_s, _ASK_S), _SHORTEST_REST_S)


def _quick(context: JobContext, now_s: float) -> list[Round]:
    stale, clock = StaleWatch(), ClockWatch()
    return [
        Round("clock", _CLOCK_S, lambda: clock.look(context), now_s),
        Round("sweep", _SWEEP_S, lambda: run_sweep(context), now_s),
        Round(
            "reconcile",
            context.settings.reconcile_s,
            lambda: run_reconcile(context, stale),
            now_s,
        ),
    ]


def _hourly(context: JobContext, now_s: float) -> list[Round]:
    hourly_s = now_s + _FIRST_HOURLY_S
    return [
        # Before retention, so that the hours that a rhythm is learned of are counted whole.
        Round("rhythms", _HOUR_S, lambda: run_rhythms(context), hourly_s, steps=True),
        Round("retention", _HOUR_S, lambda: run_retention(context), hourly_s, steps=True),
        Round("finished_jobs", _HOUR_S, engine.forget_finished, hourly_s),
    ]
