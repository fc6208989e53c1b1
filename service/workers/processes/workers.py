"""The workers that live, by signs of life that no clock can set back."""

import hashlib
import socket
import time
from datetime import timedelta

from sqlalchemy.orm import Session

from service.job_queue import JobQueue
from service.settings import Settings
from service.store import workers
from service.store.engines.dialects import now_in
from service.store.workers import WorkerRecord

WORKERS = "workers/"  # what is written about
_FORGET_LOST = timedelta(days=7)


def worker_name(settings: Settings, name: str) -> str:
    """The name of a worker among all of its store: on a server, its machine's is in it."""
    if settings.database_url is None or "@" in name:
        return name
    folder = hashlib.sha256(str(settings.data_dir.absolute()).encode()).hexdigest()[:6]
    return f"{name}@{socket.gethostname()}-{folder}"


def register_worker(session: Session, name: str, pid: int) -> None:
    """Record that a worker's process has started."""
    now = now_in(session)
    record = session.get(WorkerRecord, name) or workers.add(session, name, pid, now)
    record.pid, record.started_at, record.heartbeat_at = pid, now, now
    record.beats += 1
    record.starts += 1
    record.lost = False


def take_setback(session: Session) -> timedelta:
    """The least time by which the clock was set back since a worker was last heard of; told once.

    None of them saw that happen: each was ended before, or is only just being started.
    """
    now = now_in(session)
    ahead = [record for record in workers.every(session) if record.heartbeat_at > now]
    back = max((record.heartbeat_at - now for record in ahead), default=timedelta())
    for record in ahead:
        record.heartbeat_at = now
    return back


def heartbeat(session: Session, name: str, pid: int) -> bool:
    """Record that a worker is alive; False where its jobs were given to others meanwhile."""
    record = session.get(WorkerRecord, name)
    if record is None or record.lost or record.pid != pid:
        return False
    record.heartbeat_at = now_in(session)
    record.beats += 1
    return True


def note_trouble(session: Session, name: str, trouble: str | None) -> None:
    """Record what `serve` has to say of a worker that it cannot keep alive; None takes it back."""
    record = session.get(WorkerRecord, name)
    if record is None and trouble is not None:
        record = workers.add(session, name, 0, now_in(session))
        record.lost = True  # it has never been heard of
    if record is not None:
        record.trouble = trouble


class Watch:
    """One worker's eye on the others: lost is who has shown no sign of life for a while.

    The while is measured here, by the monotonic clock: whoever watches anew waits anew, and a
    clock that is set forward makes nobody lost.
    """

    def __init__(self) -> None:
        self._seen: dict[str, tuple[int, float]] = {}

    def take_lost(self, session: Session, queue: JobQueue, lost_s: float) -> list[str]:
        """Names of workers that have fallen silent; among all watchers each is named once.

        Their unfinished jobs are the queue's again, in this transaction: given back after it, they
        would be taken from a process of that name that has just started, and has begun them anew.
        """
        now_s = time.monotonic()
        seen, lost = {}, []
        for record in workers.every(session):
            if record.lost:
                continue
            beats, since_s = self._seen.get(record.name, (None, now_s))
            if beats != record.beats:
                since_s = now_s
            if now_s - since_s > lost_s:
                record.lost = True
                lost.append(record.name)
            else:
                seen[record.name] = (record.beats, since_s)
        self._seen = seen
        if lost:
            queue.requeue_of(session, lost)
        workers.forget_lost(session, now_in(session) - _FORGET_LOST)
        return lost
