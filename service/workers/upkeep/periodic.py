"""The periodic work of the workers: one of them does it, by the monotonic clock.

Which one is told by a lock, that is let go of however its holder ends: no clock has a say in it.
What is done each hour, and reports, have a thread of their own: they may take minutes, and alerts
and deliveries do not wait for them.
"""

import logging
import threading
import time
from collections.abc import Callable
from contextlib import closing, nullcontext
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from sqlalchemy.orm import Session

from models.durations import HOUR_S
from service.alerts.arrival_models import compute_arrival_model, load_arrivals, save_arrival_model
from service.alerts.staleness import StaleWatch
from service.data_dir import ROUNDS
from service.errors import ServiceError
from service.store import cameras
from service.store.engines.dialects import now_in
from service.store.engines.store import Lock
from service.store.stamps import follow_clock
from service.workers import engine
from service.workers.context import UPKEEP, JobContext
from service.workers.processes.workers import take_setback
from service.workers.upkeep.reconciliation import run_reconcile, run_sweep
from service.workers.upkeep.reports import ReportRounds
from service.workers.upkeep.retention import run_retention
from service.workers.upkeep.snapshots import SnapshotRounds

log = logging.getLogger("surefoot.worker")

_SHORTEST_REST_S, _ASK_S = 0.05, 1.0
_SWEEP_S = 0.5
_CLOCK_S = 1.0
_SNAPSHOTS_S = 2.0
_REPORTS_S = 10.0
_FIRST_HOURLY_S = 120.0  # a service that is restarted every half an hour has its turn too
_JUMP_S = 2.0


@dataclass(slots=True)
class Periodic:
    """Something to do every so often; what fails is logged, and done again at its next time.

    One in `steps` counts each of its steps as running, since all together have no limit.
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
            with nullcontext() if self.steps else context.running.job(UPKEEP, self.name):
                self.do()
        except ServiceError as error:  # a full disk, for example
            log.warning("round_failed", extra={"round": self.name, "why": error.detail})
        except Exception:
            log.exception("round_failed", extra={"round": self.name})
        self.due_s = time.monotonic() + self.every_s


def start_periodic_work(context: JobContext) -> None:
    """Do the periodic work in a thread, as soon as no other worker does."""
    threading.Thread(target=_go, args=(context,), name="rounds", daemon=True).start()


def _go(context: JobContext) -> None:
    with closing(context.store.lock(ROUNDS)) as lock:
        while not context.stopping.is_set():
            if lock.held():
                _work(context, lock)
            context.stopping.wait(_ASK_S)


def _work(context: JobContext, lock: Lock) -> None:
    """Do the periodic work until the process is to end, or the lock is another's."""
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
    hourly.join()  # the lock is held until nobody works on it


def _repeat(context: JobContext, tasks: list[Periodic], goes_on: Callable[[], bool]) -> None:
    rest_s = 0.0
    while not context.stopping.wait(rest_s) and goes_on():
        for each in tasks:
            each.do_if_due(context)
        due_s = min(each.due_s for each in tasks) - time.monotonic()
        rest_s = max(min(due_s, _ASK_S), _SHORTEST_REST_S)


def _quick(context: JobContext, now_s: float) -> list[Periodic]:
    stale, clock, snapshots = StaleWatch(), ClockWatch(), SnapshotRounds()
    return [
        Periodic("clock", _CLOCK_S, lambda: clock.look(context), now_s),
        Periodic("sweep", _SWEEP_S, lambda: run_sweep(context), now_s),
        Periodic(
            "reconcile",
            context.settings.reconcile_s,
            lambda: run_reconcile(context, stale),
            now_s,
        ),
        Periodic("snapshots", _SNAPSHOTS_S, lambda: snapshots.run(context), now_s),
    ]


def _hourly(context: JobContext, now_s: float) -> list[Periodic]:
    hourly_s, reports = now_s + _FIRST_HOURLY_S, ReportRounds()
    return [
        Periodic("reports", _REPORTS_S, lambda: reports.run(context), now_s),
        # Before retention, so that the hours that an arrival model is learned of are counted whole.
        Periodic("rhythms", HOUR_S, lambda: run_arrival_models(context), hourly_s, steps=True),
        Periodic("retention", HOUR_S, lambda: run_retention(context), hourly_s, steps=True),
        Periodic("finished_jobs", HOUR_S, engine.forget_finished, hourly_s),
    ]


class ClockWatch:
    """Compares the clock with the monotonic one, that nobody sets."""

    def __init__(self) -> None:
        self._ahead_s = time.time() - time.monotonic()

    def look(self, context: JobContext) -> None:
        """Follow the clock, where it was set back since the last look."""
        ahead_s = time.time() - time.monotonic()
        back_s = self._ahead_s - ahead_s
        if back_s >= _JUMP_S:
            with context.store.write() as session:
                _follow(context, session, timedelta(seconds=back_s))
        self._ahead_s = ahead_s  # not before: where nothing could be written, it is seen again


def follow_clock_since_last_run(context: JobContext) -> None:
    """The same of a clock that was set back while no worker watched; before a worker registers."""
    with context.store.write() as session:
        back = take_setback(session)
        if back.total_seconds() >= _JUMP_S:
            _follow(context, session, back)


def _follow(context: JobContext, session: Session, back: timedelta) -> None:
    now = now_in(session)
    moved = follow_clock(session, back, now, context.settings.max_ahead_s)
    context.queue.follow_clock(session, back, now)
    log.warning("clock_set_back", extra={"by_s": round(back.total_seconds()), "times": moved})


def run_arrival_models(context: JobContext) -> None:
    """Learn every camera's arrival model anew, before retention: its hours are counted whole."""
    with context.store.read() as session:
        ids = cameras.ids(session)
    learned = 0
    for camera_id in ids:
        with context.running.job(UPKEEP, "rhythms", camera_id):
            learned += _learn(context, camera_id)
    log.info("rhythms_learned", extra={"cameras": learned})


def _learn(context: JobContext, camera_id: str) -> bool:
    now = datetime.now(UTC)
    with context.store.read() as session:
        arrivals = load_arrivals(session, camera_id, now)
    if arrivals is None:
        return False
    model, counts = compute_arrival_model(arrivals, context.settings, now)
    with context.store.write(camera_id) as session:
        save_arrival_model(session, camera_id, model, counts, now)
    return model is not None
