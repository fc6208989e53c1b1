"""The one place that knows the job engine: what the rest of the service says to it.

Jobs are rows of the same SQLite file, so enqueueing is part of the caller's transaction. Nothing
here imports torch; the HTTP process holds a `JobQueue`, the worker process runs the jobs.
"""

import logging
from typing import Any

from dbos import DBOS, DBOSClient, DBOSConfig, EnqueueOptions
from sqlalchemy import Engine
from sqlalchemy.orm import Session

from service.settings import Settings

APPLICATION = "surefoot"
# Jobs belong to a version; it changes only when jobs that were queued before cannot be run.
JOBS_VERSION = "1"
TRAIN_QUEUE, ESTIMATE_QUEUE, HOUSEKEEPING_QUEUE = "train", "estimate", "housekeeping"
DELIVER_QUEUE = "deliver"
# Of the engine's tables those that nothing works without.
ENGINE_TABLES = ("workflow_status", "workflow_input", "workflow_schedules", "queues")
TRAIN_JOB, ESTIMATE_JOB, DELIVER_JOB = "train", "estimate", "deliver"


class JobQueue:
    """Enqueues and cancels jobs inside the caller's transaction; runs none."""

    def __init__(self, engine: Engine) -> None:
        self._client = DBOSClient(
            system_database_engine=engine, application_name=APPLICATION, lazy=True
        )

    def enqueue_training(self, session: Session, camera_id: str, training_id: str) -> None:
        """Queue a training; at most one of a camera runs at once."""
        self._enqueue(
            session,
            {
                "workflow_name": TRAIN_JOB,
                "queue_name": TRAIN_QUEUE,
                "workflow_id": f"train-{training_id}",
                "queue_partition_key": camera_id,
            },
            training_id,
        )

    def enqueue_estimate(self, session: Session, camera_id: str) -> None:
        """Queue a look at a camera's new tracks; at most one of a camera runs at once."""
        self._enqueue(
            session,
            {
                "workflow_name": ESTIMATE_JOB,
                "queue_name": ESTIMATE_QUEUE,
                "queue_partition_key": camera_id,
            },
            camera_id,
        )

    def enqueue_deliver(self, session: Session, webhook_id: str) -> None:
        """Queue the sending of what a webhook is due; at most one of a webhook runs at once."""
        self._enqueue(
            session,
            {
                "workflow_name": DELIVER_JOB,
                "queue_name": DELIVER_QUEUE,
                "queue_partition_key": webhook_id,
            },
            webhook_id,
        )

    def close(self) -> None:
        """Let go of the engine's connections."""
        self._client.destroy()

    def _enqueue(self, session: Session, options: EnqueueOptions, *args: Any) -> None:
        options["app_version"] = JOBS_VERSION
        self._client.enqueue_in_transaction(session, options, *args)


def queue_of(session: Session) -> JobQueue:
    """The queue in a session's own database, where nobody handed one down."""
    bind = session.get_bind()
    return JobQueue(bind if isinstance(bind, Engine) else bind.engine)


def migrate_engine_tables(settings: Settings) -> None:
    """Create or upgrade the engine's own tables; they are not Alembic's."""
    logging.getLogger("dbos").setLevel(logging.WARNING)
    DBOS.migrate(settings.database_url)


def engine_config(settings: Settings, worker_name: str) -> DBOSConfig:
    """The engine's configuration in a worker process; its name finds its own jobs again."""
    return {
        "name": APPLICATION,
        "system_database_url": settings.database_url,
        "application_version": JOBS_VERSION,
        "executor_id": worker_name,
        "run_migrations": False,
        "enable_otlp": False,
        "log_level": "WARNING",
        "scheduler_polling_interval_sec": 1.0,
    }
