"""Take a person's answer about a camera back, as long as nothing else hangs on it.

What an answer changes is kept with its entry in the log, as it was before: alerts, how far the
reference is trusted, the streak of the newest estimate, the prior pose, zones. What it made is
deleted with what came of it, and a look is asked for.
"""

from datetime import UTC, datetime, timedelta
from typing import Any

from sqlalchemy.orm import Session

from service.access.activity import note
from service.alerts.alerts import reopen_alert
from service.cameras.answers import ANSWERS, Decision
from service.cameras.cameras import require_camera
from service.cameras.poses import PoseView, view_pose
from service.enums import Activity, AlertState
from service.errors import ConflictError
from service.estimate_queue import request_estimate
from service.job_queue import JobQueue
from service.notifications.events import tell_of_camera
from service.notifications.outbox import json_time
from service.settings import Settings
from service.store import alerts, cameras, estimates, journal, references, zones
from service.store.alerts import AlertRecord
from service.store.cameras import PriorPoseRecord
from service.store.journal import ActivityRecord
from service.training import stop_trainings, train_by_itself

UNDO_WITHIN = timedelta(minutes=15)  # people who came since tell by then, and learning has begun
# After these there is no going back to what was before an answer.
_BARRIERS = (
    Activity.CAMERA_REGISTERED,  # another may have had the id before
    Activity.POSE_UNDONE,
    Activity.POSE_CONFIRMED,
    Activity.CAMERA_CHANGED,
    Activity.REFERENCE_LEARNED,
    Activity.SOURCE_USED,
    Activity.ZONES_DRAWN,
)
_TIMES = ("answered_at", "drift_after", "drift_since")


def last_answer(session: Session, camera_id: str, now: datetime) -> ActivityRecord | None:
    """The answer that can be taken back; None where there is none, or something hangs on it."""
    entry = journal.newest_of(session, camera_id, (*ANSWERS, *_BARRIERS))
    # Either way: the log keeps times of before the clock was set back.
    if entry is None or entry.what not in ANSWERS or abs(now - entry.at) > UNDO_WITHIN:
        return None
    before = entry.details.get("before")
    if before is None or alerts.pose_doubted(session, camera_id):
        return None  # people have told anew
    learned_at = references.map_learned_at(session, before["reference_id"])
    return None if learned_at is not None and learned_at > entry.at else entry


def undo_answer(
    session: Session, queue: JobQueue, settings: Settings, decision: Decision
) -> PoseView:
    """Restore what was before the last answer about a camera.

    Raises:
        NotFoundError: there is no such camera.
        ConflictError: nobody has answered of late, or something hangs on the answer by now.
    """
    camera_id = decision.camera_id
    require_camera(session, camera_id)
    entry = last_answer(session, camera_id, datetime.now(UTC))
    if entry is None:
        minutes = UNDO_WITHIN.total_seconds() / 60
        raise ConflictError(
            f"pose: there is nothing to undo: nobody has answered within {minutes:g} minutes, or "
            "something was said or learned since"
        )
    before = entry.details["before"]
    _restore_pose(session, queue, settings, camera_id, before)
    _restore_judgement(session, camera_id, before)
    for alert_id in before["alerts"]:
        record = session.get(AlertRecord, alert_id)
        if record is not None and record.state == AlertState.RESOLVED:
            reopen_alert(session, record, decision.by)
    details = {"answer": entry.what, "at": json_time(entry.at)}
    note(
        session,
        Activity.POSE_UNDONE,
        by=decision.by,
        camera_id=camera_id,
        text=decision.note,
        details=details,
    )
    tell_of_camera(session, camera_id)
    request_estimate(session, queue, camera_id)
    return view_pose(session, settings, camera_id)


def _restore_pose(
    session: Session, queue: JobQueue, settings: Settings, camera_id: str, before: dict[str, Any]
) -> None:
    """Delete the prior pose and the references that an answer made, with what hangs on them."""
    drawn = zones.of_camera(session, camera_id)
    if drawn is not None and before["zones"] is not None:
        for name, value in before["zones"].items():
            setattr(drawn, name, value)
        session.flush()
    prior = cameras.prior_pose(session, camera_id)
    if prior.id != before["prior_pose_id"]:
        stop_trainings(session, camera_id)
        session.flush()
        session.delete(session.get_one(PriorPoseRecord, prior.id))
        session.flush()
        session.expire_all()
        train_by_itself(session, queue, settings, camera_id)
    references.forget_later(session, camera_id, before["reference_id"])
    estimates.forget_later(session, camera_id, before["estimate_id"] or 0)
    session.expire_all()


def _restore_judgement(session: Session, camera_id: str, before: dict[str, Any]) -> None:
    reference = references.newest(session, camera_id)
    for name, value in before["reference"].items():
        setattr(reference, name, _read(value) if name in _TIMES else value)
    last = estimates.newest(session, camera_id)
    if last is not None and before["streak"] is not None:
        for name, value in before["streak"].items():
            setattr(last, name, _read(value) if name in _TIMES else value)


def _read(text: str | None) -> datetime | None:
    return None if text is None else datetime.fromisoformat(text)
