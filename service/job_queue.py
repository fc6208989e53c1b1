"""The one place that knows the job engine: what the rest of the service says to it.

Jobs are rows of the same database, so enqueueing is part of the caller's transaction. Nothing
here imports torch; the HTTP process holds a `JobQueue`, the worker process runs the jobs. What a
job is about is kept as JSON: whoever can write a row, or has made a backup, gets no code run by it.
"""

import contextlib
import logging
import secrets
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from typing import Any, NoReturn

from dbos import DBOS, DBOSClient, DBOSConfig, DBOSPortableJSONSerializer, error
from dbos._serialization import DefaultSerializer  # private; pinned, see _refuse_pickle
from sqlalchemy import Engine, TextClause, bindparam, select, text
from sqlalchemy.orm import Session

from service.settings import Settings
from service.store.cameras import CameraRecord
from service.store.engines.store import engine_for, savepoint

log = logging.getLogger("surefoot.jobs")

APPLICATION = "surefoot"
# Jobs belong to a version; it changes only when jobs that were queued before cannot be run.
JOBS_VERSION = "1"
TRAIN_JOB, ESTIMATE_JOB, DELIVER_JOB = "train", "estimate", "deliver"  # and the queue of each
_JSON = DBOSPortableJSONSerializer()
JOBS_FORM = _JSON.name()
# The engine's tables whose rows name how their content is written.
_SERIALIZED = (
    *("workflow_status", "operation_outputs", "notifications", "streams"),
    *("workflow_events", "workflow_events_history"),
)
_CONTENT = ("workflow_input", "workflow_output")  # of rows of workflow_status
# All of the engine's but the number of its schema. What is in them is made anew when it is gone:
# the store's own marks say what is to be done.
ENGINE_TABLES = (
    *(*_SERIALIZED, *_CONTENT),
    *("workflow_schedules", "queues", "application_versions"),
)
ENGINE_REVISION = "dbos_migrations"  # the engine makes its tables anew if this one is missing
_ENGINE_CONNECTIONS = 5  # to a server, of each worker
# The engine's priorities are whole numbers from 1 to 2**31 - 1, the smallest first: 68 years.
_BEGINNING = datetime(2026, 1, 1, tzinfo=UTC)
_HEAD_START = timedelta(seconds=30)
_UNDER_WAY = ("ENQUEUED", "DELAYED", "PENDING")

# Of the engine's own table, what its client has no call for: each is answered by an index of it.
# Twice a second, of thousands of cameras that are due: told by the database, without their records.
_DUE_WITHOUT = (
    select(CameraRecord.id, CameraRecord.estimate_due_at, CameraRecord.estimate_after)
    .where(
        CameraRecord.estimate_due_at.is_not(None),
        text(
            "NOT EXISTS (SELECT 1 FROM workflow_status "
            "WHERE queue_name = :queue AND deduplication_id = cameras.id)"
        ),
    )
    .order_by(CameraRecord.estimate_due_at, CameraRecord.id)
)
_WAITS = text(
    "SELECT 1 FROM workflow_status WHERE queue_name = :queue AND status = 'ENQUEUED' "
    "AND queue_partition_key = :key LIMIT 1"
)
_ANY_WAITS = text(
    "SELECT 1 FROM workflow_status WHERE queue_name = :queue AND status = 'ENQUEUED' "
    "AND deduplication_id <> :besides LIMIT 1"
)
_STATUS = text(
    "SELECT status FROM workflow_status WHERE workflow_uuid = :id OR workflow_uuid LIKE :again"
)
# As the engine's own recovery does, which would have a transaction of its own.
_REQUEUE = text(
    "UPDATE workflow_status SET status = 'ENQUEUED', owner_xid = NULL, started_at_epoch_ms = NULL "
    "WHERE status = 'PENDING' AND executor_id IN :workers"
).bindparams(bindparam("workers", expanding=True))


_BRING_FORWARD = text(
    "UPDATE workflow_status SET priority = priority - :back WHERE queue_name = :queue "
    "AND status = 'ENQUEUED' AND priority > :now AND priority > :back"
)


class JobQueue:
    """Enqueues and cancels jobs inside the caller's transaction; runs none."""

    def __init__(self, engine: Engine) -> None:
        self._client = DBOSClient(
            system_database_engine=engine,
            application_name=APPLICATION,
            lazy=True,
            serializer=_JSON,
        )

    def enqueue_training(self, session: Session, camera_id: str, training_id: str) -> None:
        """Queue a training; at most one of a camera runs at once."""
        self._enqueue_training(session, camera_id, training_id, f"train-{training_id}")

    def requeue_training(self, session: Session, camera_id: str, training_id: str) -> bool:
        """Queue a training again whose job has failed or is gone; False where it is under way."""
        job_id = f"train-{training_id}"
        statuses = session.scalars(_STATUS, {"id": job_id, "again": f"{job_id}-again-%"})
        if any(status in _UNDER_WAY for status in statuses):
            return False
        again_id = f"{job_id}-again-{secrets.token_hex(4)}"
        self._enqueue_training(session, camera_id, training_id, again_id)
        return True

    def enqueue_estimate(
        self, session: Session, camera_id: str, due_at: datetime, *, urgent: bool = False
    ) -> None:
        """Queue a look at a camera's new tracks, unless one waits or runs already.

        Those that were due first come first; one that is `urgent` as if it had been due for half a
        minute more, so that many of these hold up others by no more than that. While one runs, the
        camera's mark "due" stays: the next sweep sees it.
        """
        due_at = due_at - _HEAD_START if urgent else due_at
        priority = _priority_of(due_at)
        # Outside the savepoint: one that is refused takes nothing of the caller's with it.
        with contextlib.suppress(error.DBOSQueueDeduplicatedError), savepoint(session):
            self._enqueue(
                session, ESTIMATE_JOB, camera_id, deduplication_id=camera_id, priority=priority
            )

    def due_without_job(self, session: Session) -> Sequence[tuple[str, datetime, datetime | None]]:
        """Cameras due without an estimate job, longest due first: since when, and the cooldown."""
        rows = session.execute(_DUE_WITHOUT, {"queue": ESTIMATE_JOB})
        return [(camera_id, due_at, until) for camera_id, due_at, until in rows if due_at]

    def estimates_wait(self, session: Session, besides: str = "") -> bool:
        """True where an estimate job of another camera waits for a free worker."""
        values = {"queue": ESTIMATE_JOB, "besides": besides}
        return session.scalar(_ANY_WAITS, values) is not None

    def enqueue_deliver(self, session: Session, webhook_id: str) -> None:
        """Queue the sending of what a webhook is due, unless a job waits to start that does.

        At most one of a webhook runs at once.
        """
        if session.scalar(_WAITS, {"queue": DELIVER_JOB, "key": webhook_id}) is None:
            self._enqueue(session, DELIVER_JOB, webhook_id, queue_partition_key=webhook_id)

    def requeue_of(self, session: Session, workers: Sequence[str]) -> None:
        """Give the unfinished jobs of lost workers back to the queue."""
        session.execute(_REQUEUE, {"workers": list(workers)})

    def follow_clock(self, session: Session, set_back_by: timedelta, now: datetime) -> None:
        """Give estimate jobs that wait the priority of the time at which their camera was due.

        They would wait behind all later ones for as long as the clock jumped back.
        """
        values = {
            "queue": ESTIMATE_JOB,
            "back": round(set_back_by.total_seconds()),
            "now": _priority_of(now),
        }
        session.execute(_BRING_FORWARD, values)

    def close(self) -> None:
        """Let go of the engine's connections."""
        self._client.destroy()

    def _enqueue_training(
        self, session: Session, camera_id: str, training_id: str, job_id: str
    ) -> None:
        self._enqueue(
            session, TRAIN_JOB, training_id, workflow_id=job_id, queue_partition_key=camera_id
        )

    def _enqueue(self, session: Session, job: str, about: str, **more: Any) -> None:
        options: Any = {"workflow_name": job, "queue_name": job, "app_version": JOBS_VERSION}
        self._client.enqueue_in_transaction(session, options | more, about)


def _priority_of(due_at: datetime) -> int:
    return max(round((due_at - _BEGINNING).total_seconds()), 1)


def queue_of(session: Session) -> JobQueue:
    """The queue in a session's own database, where nobody handed one down."""
    bind = session.get_bind()
    return JobQueue(bind if isinstance(bind, Engine) else bind.engine)


def migrate_engine_tables(settings: Settings) -> None:
    """Create or upgrade the engine's own tables; they are not Alembic's.

    Jobs that are no JSON, whoever wrote them, are deleted; the upkeep queues anew what is still to
    be done.
    """
    logging.getLogger("dbos").setLevel(logging.WARNING)
    DBOS.migrate(settings.store_url)
    engine = engine_for(settings.store_url)
    try:
        if forgotten := _forget_pickles(engine):
            log.warning("pickled_jobs_deleted", extra={"rows": forgotten})
    finally:
        engine.dispose()


def _forget_pickles(engine: Engine) -> int:
    with engine.connect() as connection:  # nothing waits for who writes, where there is none
        found = [table for table in _SERIALIZED if connection.scalar(*_strange("SELECT 1", table))]
    if not found:
        return 0
    with engine.begin() as connection:
        forgotten = sum(connection.execute(*_strange("DELETE", table)).rowcount for table in found)
        for table in _CONTENT:
            kept = "SELECT workflow_uuid FROM workflow_status"
            connection.execute(text(f"DELETE FROM {table} WHERE workflow_uuid NOT IN ({kept})"))
    return forgotten


def _strange(act: str, table: str) -> tuple[TextClause, dict[str, str]]:
    return text(f"{act} FROM {table} WHERE serialization <> :json"), {"json": JOBS_FORM}


def _refuse_pickle(cls: DefaultSerializer, serialized_data: str) -> NoReturn:
    raise ValueError("a job is kept as a pickle, which may be any code: it is not read")


# Each row says how it is to be read, whatever serializer the engine was given: "py_pickle" would
# run what it holds. `tests/service/workers/test_pickles.py` plants one.
DefaultSerializer.deserialize = _refuse_pickle  # type: ignore[method-assign]


def engine_config(settings: Settings, worker_name: str) -> DBOSConfig:
    """The engine's configuration in a worker process; its name finds its own jobs again."""
    config: DBOSConfig = {
        "name": APPLICATION,
        "system_database_url": settings.store_url,
        "application_version": JOBS_VERSION,
        "executor_id": worker_name,
        "run_migrations": False,
        "enable_otlp": False,
        "serializer": _JSON,
        "log_level": "WARNING",
        "scheduler_polling_interval_sec": 1.0,
    }
    if settings.database_url is not None:
        config["sys_db_pool_size"] = _ENGINE_CONNECTIONS
    return config
