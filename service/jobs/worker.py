"""The worker process: runs the engine's jobs until it is told to stop."""

import fcntl
import logging
import os
import signal
import sys
import threading
from datetime import datetime, timedelta
from typing import Any

import torch
from dbos import DBOS
from dbos._recovery import recover_pending_workflows  # private; pinned, see take_over

from service.job_queue import (
    DELIVER_JOB,
    DELIVER_QUEUE,
    ESTIMATE_JOB,
    ESTIMATE_QUEUE,
    HOUSEKEEPING_QUEUE,
    TRAIN_JOB,
    TRAIN_QUEUE,
    JobQueue,
    engine_config,
)
from service.jobs.context import JobContext
from service.jobs.deliver import run_deliver
from service.jobs.estimate import run_estimate
from service.jobs.housekeeping import run_reconcile
from service.jobs.retention import run_retention
from service.jobs.rhythms import run_rhythms
from service.jobs.train import run_training
from service.recalibration import upkeep
from service.settings import Settings
from service.store.database import Store

log = logging.getLogger("surefoot.worker")

_HEARTBEAT_S = 2.0
_POLL_S = 0.2
_KEEP_FINISHED = timedelta(hours=1)
_ESTIMATES_AT_ONCE = 2
_DELIVERIES_AT_ONCE = 16  # they wait for other machines most of the time


class WorkerRunningError(RuntimeError):
    """Another process works under this name; two would run each other's jobs."""


def run_worker(settings: Settings, name: str, follow_stdin: bool) -> None:
    """Run jobs until SIGTERM or SIGINT, or until stdin ends if that is to be followed.

    The name must be stable: the engine finds a worker's unfinished jobs by it.

    Raises:
        WorkerRunningError: a worker of this name is running already.
    """
    lock = (settings.data_dir / f"worker-{name}.lock").open("w")
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        raise WorkerRunningError(f"name: worker {name!r} is running already") from error
    torch.set_num_threads(settings.training_threads)
    store = Store(settings)
    context = JobContext(settings=settings, store=store, queue=JobQueue(store.engine))
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: context.stopping.set())
    if follow_stdin:
        threading.Thread(target=_stop_at_end_of_stdin, args=(context,), daemon=True).start()
    _launch(context, name)
    log.info("worker_started", extra={"worker": name, "pid": os.getpid()})
    while not context.stopping.wait(_HEARTBEAT_S):
        with store.write() as session:
            upkeep.heartbeat(session, name, os.getpid())
            lost = upkeep.take_lost_workers(session, settings)
        if lost:
            _take_over(lost)
    log.info("worker_stopping", extra={"worker": name})
    DBOS.destroy(workflow_completion_timeout_sec=0)
    # A training in hand is parked, not ended (see jobs/train.py); its thread is not waited for.
    logging.shutdown()
    os._exit(0)


def _launch(context: JobContext, name: str) -> None:
    settings = context.settings
    DBOS(config=engine_config(settings, name))

    @DBOS.workflow(name=TRAIN_JOB)
    def train(training_id: str) -> None:
        _guarded(run_training, context, training_id)

    @DBOS.workflow(name=ESTIMATE_JOB)
    def estimate(camera_id: str) -> None:
        _guarded(run_estimate, context, camera_id)

    @DBOS.workflow(name=DELIVER_JOB)
    def deliver(webhook_id: str) -> None:
        _guarded(run_deliver, context, webhook_id)

    @DBOS.workflow(name="reconcile")
    def reconcile(at: datetime, _: Any) -> None:
        _guarded(run_reconcile, context)

    @DBOS.workflow(name="retention")
    def retention(at: datetime, _: Any) -> None:
        _guarded(run_rhythms, context)
        _guarded(run_retention, context)
        _forget_finished()

    DBOS.launch()
    with context.store.write() as session:
        upkeep.heartbeat(session, name, os.getpid())
    DBOS.register_queue(
        TRAIN_QUEUE,
        partition_concurrency=1,
        global_concurrency=settings.trainings_at_once,
        polling_interval_sec=_POLL_S,
        on_conflict="always_update",
    )
    DBOS.register_queue(
        ESTIMATE_QUEUE,
        partition_concurrency=1,
        worker_concurrency=_ESTIMATES_AT_ONCE,
        polling_interval_sec=_POLL_S,
        on_conflict="always_update",
    )
    DBOS.register_queue(
        DELIVER_QUEUE,
        partition_concurrency=1,
        worker_concurrency=_DELIVERIES_AT_ONCE,
        polling_interval_sec=_POLL_S,
        on_conflict="always_update",
    )
    DBOS.register_queue(HOUSEKEEPING_QUEUE, global_concurrency=1, on_conflict="always_update")
    DBOS.apply_schedules(
        [
            {
                "schedule_name": "reconcile",
                "workflow_fn": reconcile,
                "schedule": f"*/{settings.reconcile_s} * * * * *",
                "queue_name": HOUSEKEEPING_QUEUE,
            },
            {
                "schedule_name": "retention",
                "workflow_fn": retention,
                "schedule": "17 7 * * * *",
                "queue_name": HOUSEKEEPING_QUEUE,
            },
        ]
    )


def _guarded(job: Any, context: JobContext, *args: str) -> None:
    """Run a job; what it did not foresee is logged, and the reconcile finds the work again."""
    try:
        job(context, *args)
    except Exception:
        log.exception("job_failed", extra={"job": job.__name__, "arguments": args})
        raise


def _take_over(lost: list[str]) -> None:
    """Give the unfinished jobs of lost workers back to the queue.

    The engine offers this only with its paid conductor; the call is private, so the version is
    pinned and `tests/service/test_workers.py` kills a worker to try it.
    """
    from dbos._dbos import _get_dbos_instance

    log.warning("workers_lost", extra={"workers": lost})
    recover_pending_workflows(_get_dbos_instance(), lost)


def _forget_finished() -> None:
    """Delete the engine's rows of jobs that ended a while ago."""
    before = (datetime.now().astimezone() - _KEEP_FINISHED).isoformat()
    ended = DBOS.list_workflows(
        status=["SUCCESS", "ERROR", "CANCELLED"],
        end_time=before,
        limit=5000,
        load_input=False,
        load_output=False,
    )
    if ended:
        DBOS.delete_workflows([workflow.workflow_id for workflow in ended])


def _stop_at_end_of_stdin(context: JobContext) -> None:
    """`serve` holds the other end: when it dies in whatever way, its workers end too."""
    sys.stdin.buffer.read()
    context.stopping.set()
