"""Requests for an estimate: a camera is due, and its job is queued."""

from datetime import UTC, datetime

from sqlalchemy.orm import Session

from service.job_queue import JobQueue
from service.store import cameras
from service.windows.looking import may_look


def request_estimate(
    session: Session, queue: JobQueue, camera_id: str, *, watched: bool = False
) -> None:
    """Have a camera's tracks looked at; requests that wait already cover this one.

    Before others where somebody has `watched` it, or it may have moved. One that rests, or is being
    looked at, is queued by the upkeep when its time has come.
    """
    camera = cameras.find(session, camera_id)
    if camera is not None and camera.estimate_due_at is None:
        now = datetime.now(UTC)
        camera.estimate_due_at = now
        if may_look(camera, now):
            queue.enqueue_estimate(session, camera_id, now, urgent=watched or camera.urgent)
