"""What operators of the service itself ask: is it ready, what happened."""

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session

from service.errors import OverloadedError
from service.settings import Settings
from service.store import cameras, events, probes, workers
from service.store.database import Store
from service.store.failures import failure_of
from service.store.tables import EventRecord


@dataclass(frozen=True, slots=True, kw_only=True)
class Readiness:
    """Whether the service can do its work, and if not, why."""

    store_writable: bool
    worker_alive: bool
    worker_silent_s: float | None
    queue_lag_s: float
    problems: tuple[str, ...]

    @property
    def ready(self) -> bool:
        """All is well."""
        return not self.problems


def check_readiness(store: Store, settings: Settings) -> Readiness:
    """Write something; look at the disk, the workers and the oldest waiting camera."""
    now = datetime.now(UTC)
    try:
        with store.write() as session:
            probes.write(session, now)
        with store.read() as session:
            heartbeat = workers.newest_heartbeat(session)
            due = cameras.longest_due(session)
    except (SQLAlchemyError, OverloadedError) as error:
        known = failure_of(error) if isinstance(error, SQLAlchemyError) else error
        said = f"store: {error.__class__.__name__}: {error}" if known is None else known.detail
        return Readiness(
            store_writable=False,
            worker_alive=False,
            worker_silent_s=None,
            queue_lag_s=0.0,
            problems=(said if said.startswith("store: ") else f"store: {said}",),
        )
    silent_s = None if heartbeat is None else (now - heartbeat).total_seconds()
    alive = silent_s is not None and silent_s < settings.worker_lost_s
    lag_s = 0.0 if due is None else (now - due).total_seconds()
    problems = []
    free_mb = shutil.disk_usage(settings.data_dir).free / 2**20
    full = free_mb < _FULL_MB
    if full:
        problems.append(f"store: the disk is full, {free_mb:.1f} MiB are free")
    elif free_mb < settings.min_free_mb:
        problems.append(f"disk: {free_mb:.0f} MiB are free; {settings.min_free_mb:g} are the least")
    if not alive:
        heard = "none was ever heard of" if silent_s is None else f"silent for {silent_s:.0f} s"
        problems.append(f"worker: {heard}; up to {settings.worker_lost_s:g} s are waited for")
    if lag_s > _LONGEST_LAG_S:
        problems.append(f"queue: tracks wait for {lag_s:.0f} s; {_LONGEST_LAG_S:g} s are the limit")
    return Readiness(
        store_writable=not full,
        worker_alive=alive,
        worker_silent_s=silent_s,
        queue_lag_s=lag_s,
        problems=tuple(problems),
    )


_LONGEST_LAG_S = 60.0
_FULL_MB = 1.0  # a small write, as ours is, may still find room in the file that is there


def newest_event_id(session: Session) -> int:
    """The id of the newest event."""
    return events.newest_id(session)


def events_after(session: Session, event_id: int, limit: int) -> Sequence[EventRecord]:
    """Events after one, oldest first."""
    return events.after(session, event_id, limit)
