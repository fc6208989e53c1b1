"""The worker process: runs the engine's jobs until it is told to stop, or should start anew."""

import logging
import os
import signal
import time

from sqlalchemy.exc import SQLAlchemyError

from service.data_dir import telling_of
from service.errors import ServiceError
from service.job_queue import DELIVER_JOB, ESTIMATE_JOB, TRAIN_JOB, JobQueue
from service.settings import Settings
from service.store import runs
from service.store.engines.dialects import now_in
from service.store.engines.sqlite import FileLock
from service.store.engines.store import Store
from service.workers import engine
from service.workers.context import UPKEEP, JobContext, RunningJobs
from service.workers.heartbeat import BEAT_S, start_heartbeat
from service.workers.processes import exits
from service.workers.processes.process import (
    WorkKind,
    at_end_of_stdin,
    give_back,
    limit_memory,
    resident_mb,
    settle_allocator,
    yield_to_others,
)
from service.workers.processes.workers import (
    WORKERS,
    Watch,
    heartbeat,
    register_worker,
    worker_name,
)
from service.workers.upkeep.periodic import follow_clock_since_last_run, start_periodic_work

log = logging.getLogger("surefoot.worker")

_TRIM_EVERY_S = 30.0
# A training in hand would start over: the ceiling waits for its end, up to here.
_CEILING_IN_TRAINING = 1.5
# What one job may not allocate beyond, at any moment; stacks of threads are counted, hardly used.
_HARD_CEILING, _THREADS_MB = 1.5, 1_000.0


class WorkerRunningError(RuntimeError):
    """Another process works under this name; two would run each other's jobs."""


def run_worker(
    settings: Settings, name: str, follow_stdin: bool, only: WorkKind | None = None
) -> None:
    """Run jobs until SIGTERM or SIGINT, or until stdin ends if that is to be followed.

    The name must be stable: the engine finds a worker's unfinished jobs by it. `only` says which
    jobs it runs alone, and the others' are left to others.

    Raises:
        WorkerRunningError: a worker of this name is running already.
        StartError: the data directory is missing or cannot be written.
    """
    name = worker_name(settings, name)
    with telling_of(settings.data_dir):
        lock = FileLock(settings.data_dir / f"worker-{name}.lock")
    if not lock.held():
        raise WorkerRunningError(f"name: worker {name!r} is running already")
    settle_allocator()
    limit_memory(_HARD_CEILING * settings.worker_max_mb + _THREADS_MB)
    yield_to_others(settings.worker_nice)
    store = Store(settings)
    limits_s = {  # of a task of each kind; trainings mind theirs themselves
        ESTIMATE_JOB: settings.estimate_limit_s,
        DELIVER_JOB: settings.delivery_limit_s,
        UPKEEP: settings.upkeep_limit_s,
    }
    context = JobContext(
        settings=settings,
        store=store,
        queue=JobQueue(store.engine),
        running=RunningJobs(limits_s=limits_s),
    )
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: context.stopping.set())
    if follow_stdin:
        at_end_of_stdin(context.stopping.set)
    start_heartbeat(context, tells=follow_stdin)
    follow_clock_since_last_run(context)
    with store.write(WORKERS) as session:
        register_worker(session, name, os.getpid())
    engine.launch(context, name, only)
    if only is not WorkKind.TRAIN:
        start_periodic_work(context)
    log.info("worker_started", extra={"worker": name, "pid": os.getpid()})
    status = _mind(context, name)
    log.info("worker_stopping", extra={"worker": name})
    if status == 0:
        engine.stop(0.0).join(BEAT_S)
    # A training in hand is parked, not ended (see workers/train.py); its thread is not waited for.
    logging.shutdown()
    os._exit(status)


def _mind(context: JobContext, name: str) -> int:
    """Beat, take over from lost workers, keep below the ceiling; returns the exit status."""
    watch, settings = Watch(), context.settings
    lost_s = settings.worker_lost_s
    trimmed_s, draining = time.monotonic(), None
    while not context.stopping.wait(BEAT_S):
        made = context.runs.take()
        try:
            with context.store.write(WORKERS) as session:
                runs.add(session, made, now_in(session))
                alive = heartbeat(session, name, os.getpid())
                lost = watch.take_lost(session, context.queue, lost_s) if alive else []
            if not alive:
                log.error("worker_given_up", extra={"worker": name})
                return exits.GIVEN_UP
            if lost:
                log.warning("workers_lost", extra={"workers": lost})
        except (SQLAlchemyError, ServiceError) as error:  # a full disk, for example
            log.warning("heartbeat_failed", extra={"worker": name, "why": str(error)})
            for kind, total in made.items():
                context.runs.add(kind, total)
        if draining is not None:
            # A training beyond its own ceiling is not waited for: it would be minutes.
            if not draining.is_alive() or not context.running.of_kind(ESTIMATE_JOB, DELIVER_JOB):
                return exits.FULL
            continue
        if time.monotonic() - trimmed_s > _TRIM_EVERY_S:
            give_back()
            trimmed_s = time.monotonic()
        if _is_full(context):
            fields = {"resident_mb": round(resident_mb()), "limit_mb": settings.worker_max_mb}
            log.warning("worker_full", extra={"worker": name, **fields})
            draining = engine.stop(settings.estimate_limit_s)
    return 0


def _is_full(context: JobContext) -> bool:
    """True if a worker has grown beyond its ceiling, after all that is free was given back."""
    limit_mb: float = context.settings.worker_max_mb
    if context.running.of_kind(TRAIN_JOB):
        limit_mb *= _CEILING_IN_TRAINING
    if resident_mb() <= limit_mb:
        return False
    give_back()
    return resident_mb() > limit_mb
