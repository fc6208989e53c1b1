"""The periodic work of the workers: one of them does it, by the monotonic clock.

Which one is told by a lock on a file, that the system lets go of however its holder ends: no clock
has a say in it.
"""

import fcntl
import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from service.data_dir import ROUNDS_LOCK
from service.jobs import engine
from service.jobs.context import JobContext
from service.jobs.housekeeping import ClockWatch, run_reconcile, run_sweep
from service.jobs.retention import run_retention
from service.jobs.rhythms import run_rhythms
from service.recalibration.staleness import StaleWatch

log = logging.getLogger("surefoot.worker")

UPKEEP = "upkeep"
_TICK_S = 0.25
_SWEEP_S = 0.5
_CLOCK_S = 1.0
_HOUR_S = 3600.0
_FIRST_HOURLY_S = 120.0  # a service that is restarted every half an hour has its turn too


@dataclass(slots=True)
class Round:
    """Something to do every so often; what fails is logged, and done again at its next time."""

    name: str
    every_s: float
    do: Callable[[], object]
    due_s: float

    def do_if_due(self, context: JobContext) -> None:
        """Do it, if its time has come."""
        if time.monotonic() < self.due_s:
            return
        try:
            with context.in_hand.task(UPKEEP, self.name):
                self.do()
        except Exception:
            log.exception("round_failed", extra={"round": self.name})
        self.due_s = time.monotonic() + self.every_s


def start_rounds(context: JobContext) -> None:
    """Do the rounds in a thread, as soon as no other worker does."""
    threading.Thread(target=_go, args=(context,), name="rounds", daemon=True).start()


def _go(context: JobContext) -> None:
    with (context.settings.data_dir / ROUNDS_LOCK).open("w") as lock:
        while not _taken(lock.fileno()):
            if context.stopping.wait(1.0):
                return
        log.info("rounds_taken")
        rounds = _rounds(context, time.monotonic())
        while not context.stopping.wait(_TICK_S):
            for each in rounds:
                each.do_if_due(context)


def _rounds(context: JobContext, now_s: float) -> list[Round]:
    stale, clock = StaleWatch(), ClockWatch()
    hourly_s = now_s + _FIRST_HOURLY_S
    return [
        Round("clock", _CLOCK_S, lambda: clock.look(context), now_s),
        Round("sweep", _SWEEP_S, lambda: run_sweep(context), now_s),
        Round(
            "reconcile",
            context.settings.reconcile_s,
            lambda: run_reconcile(context, stale),
            now_s,
        ),
        # Before retention, so that the hours that a rhythm is learned of are counted whole.
        Round("rhythms", _HOUR_S, lambda: run_rhythms(context), hourly_s),
        Round("retention", _HOUR_S, lambda: run_retention(context), hourly_s),
        Round("finished_jobs", _HOUR_S, engine.forget_finished, hourly_s),
    ]


def _taken(lock: int) -> bool:
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True
