"""The engine in a worker process: which jobs it runs, forgetting those that ended, stopping."""

import logging
import threading
from datetime import datetime, timedelta
from typing import Any

from dbos import DBOS

from service.job_queue import DELIVER_JOB, ESTIMATE_JOB, TRAIN_JOB, engine_config
from service.workers.context import JobContext
from service.workers.deliver import run_deliver
from service.workers.estimate import run_estimate
from service.workers.processes.process import WorkKind
from service.workers.train import run_training

log = logging.getLogger("surefoot.worker")

# Each look at a queue takes 4 ms, whether or not there is anything in it. One for estimates starts
# two of them, so less often would be too seldom for hundreds of cameras; a delivery job sends all
# that its webhook is due, and a training takes minutes.
_POLL_S, _POLL_DELIVERIES_S, _POLL_TRAININGS_S = 0.25, 1.0, 2.0
_KEEP_FINISHED = timedelta(hours=1)
_FORGET_AT_ONCE = 500
_ESTIMATES_AT_ONCE = 2
_DELIVERIES_AT_ONCE = 16  # they wait for other machines most of the time
_ENDED = ["SUCCESS", "ERROR", "CANCELLED", "MAX_RECOVERY_ATTEMPTS_EXCEEDED"]


_QUEUES = {WorkKind.ESTIMATE: [ESTIMATE_JOB, DELIVER_JOB], WorkKind.TRAIN: [TRAIN_JOB]}


def launch(context: JobContext, name: str, only: WorkKind | None = None) -> None:
    """Run jobs from now on; those that a process of this name left unfinished come first.

    With `only`, trainings alone, or all but trainings.
    """
    DBOS(config=engine_config(context.settings, name))
    if only is not None:
        DBOS.listen_queues(_QUEUES[only])

    # However often workers die of a training, it is ours to end it, and not the engine's.
    @DBOS.workflow(name=TRAIN_JOB, max_recovery_attempts=None)
    def train(training_id: str) -> None:
        _guarded(run_training, context, TRAIN_JOB, training_id)

    @DBOS.workflow(name=ESTIMATE_JOB, max_recovery_attempts=None)
    def estimate(camera_id: str) -> None:
        _guarded(run_estimate, context, ESTIMATE_JOB, camera_id)

    @DBOS.workflow(name=DELIVER_JOB, max_recovery_attempts=None)
    def deliver(webhook_id: str) -> None:
        _guarded(run_deliver, context, DELIVER_JOB, webhook_id)

    DBOS.launch()
    DBOS.register_queue(
        TRAIN_JOB,
        partition_concurrency=1,
        global_concurrency=context.settings.trainings_at_once,
        polling_interval_sec=_POLL_TRAININGS_S,
        on_conflict="always_update",
    )
    # One job a camera, the longest due first: a flooded camera has its turn like any other.
    DBOS.register_queue(
        ESTIMATE_JOB,
        worker_concurrency=_ESTIMATES_AT_ONCE,
        polling_interval_sec=_POLL_S,
        on_conflict="always_update",
    )
    DBOS.register_queue(
        DELIVER_JOB,
        partition_concurrency=1,
        worker_concurrency=_DELIVERIES_AT_ONCE,
        polling_interval_sec=_POLL_DELIVERIES_S,
        on_conflict="always_update",
    )


def forget_finished() -> int:
    """Delete the engine's rows of jobs that ended a while ago; returns how many."""
    before = (datetime.now().astimezone() - _KEEP_FINISHED).isoformat()
    forgotten = 0
    while ended := DBOS.list_workflows(
        status=_ENDED,
        completed_before=before,
        limit=_FORGET_AT_ONCE,
        load_input=False,
        load_output=False,
    ):
        DBOS.delete_workflows([workflow.workflow_id for workflow in ended])
        forgotten += len(ended)
    return forgotten


def stop(within_s: float) -> threading.Thread:
    """Take no new job, and end when running ones have ended, or after so long."""
    thread = threading.Thread(
        target=DBOS.destroy,
        kwargs={"workflow_completion_timeout_sec": round(within_s)},
        name="stop",
        daemon=True,
    )
    thread.start()
    return thread


def _guarded(job: Any, context: JobContext, kind: str, about: str) -> None:
    """Run a job; what it did not foresee is logged, and the reconcile finds the work again."""
    try:
        with context.running.job(kind, about):
            job(context, about)
    except Exception:
        log.exception("job_failed", extra={"job": job.__name__, "arguments": [about]})
        raise
