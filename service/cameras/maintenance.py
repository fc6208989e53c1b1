"""Maintenance windows: somebody is at a camera, so nothing is judged and nobody is told."""

import secrets
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta

from sqlalchemy.orm import Session

from service.access.activity import note
from service.cameras.cameras import require_camera
from service.enums import Activity
from service.errors import ConflictError, MalformedError, NotFoundError
from service.estimate_queue import request_estimate
from service.job_queue import JobQueue
from service.notifications.outbox import json_time
from service.references import forget_streak
from service.settings import Settings
from service.store import alerts, references
from service.store.references import MaintenanceRecord

_FARTHEST = timedelta(days=366)


def open_window(
    session: Session,
    queue: JobQueue,
    settings: Settings,
    camera_id: str,
    *,
    from_at: datetime | None,
    to_at: datetime,
    reason: str | None,
    by: str | None,
) -> MaintenanceRecord:
    """Say that somebody is, was or will be at a camera; from now on, if it is not said from when.

    Raises:
        NotFoundError: there is no such camera.
        MalformedError: the times are in the wrong order or beyond the limits.
    """
    require_camera(session, camera_id)
    now = datetime.now(UTC)
    from_at = from_at or now
    _check(from_at, to_at, now, settings)
    record = MaintenanceRecord(
        id=secrets.token_hex(16),
        camera_id=camera_id,
        from_at=from_at,
        to_at=to_at,
        ended_at=to_at if to_at <= now else None,
        reason=reason,
        requested_by=by,
        created_at=now,
        updated_at=now,
    )
    session.add(record)
    session.flush()
    _note(session, Activity.MAINTENANCE_PLANNED, record, by)
    open_ = alerts.pose_doubted(session, camera_id)
    if from_at <= now and not open_:
        forget_streak(session, camera_id)  # an open alert ends by its own rules
    request_estimate(session, queue, camera_id)
    return record


def list_windows(session: Session, camera_id: str) -> Sequence[MaintenanceRecord]:
    """A camera's windows in the order of their beginnings.

    Raises:
        NotFoundError: there is no such camera.
    """
    require_camera(session, camera_id)
    return references.maintenance_of(session, camera_id)


def change_window(
    session: Session,
    queue: JobQueue,
    settings: Settings,
    camera_id: str,
    window_id: str,
    *,
    from_at: datetime | None,
    to_at: datetime | None,
    reason: str | None,
) -> MaintenanceRecord:
    """Move a window's ends: to end it now, or to have it end when somebody really left; None stays.

    Raises:
        NotFoundError: the camera has no such window.
        MalformedError: the times are in the wrong order or beyond the limits.
    """
    record = _require(session, camera_id, window_id)
    now = datetime.now(UTC)
    _check(from_at or record.from_at, to_at or record.until, now, settings)
    if to_at is not None:
        record.to_at, record.ended_at = to_at, to_at if to_at <= now else None
    record.from_at, record.updated_at = from_at or record.from_at, now
    record.reason = record.reason if reason is None else reason
    _note(session, Activity.MAINTENANCE_CHANGED, record, None)
    session.flush()
    request_estimate(session, queue, camera_id)
    return record


def end_window(
    session: Session, queue: JobQueue, camera_id: str, window_id: str, by: str | None
) -> None:
    """End a window that is under way, or take back one that has not begun; its plan stays kept.

    Raises:
        NotFoundError: the camera has no such window.
        ConflictError: it is over: what was seen in it stays unused.
    """
    record = _require(session, camera_id, window_id)
    now = datetime.now(UTC)
    if record.until <= now:
        raise ConflictError(f"to: the window ended at {record.until.isoformat()} already")
    if record.from_at >= now:
        _note(session, Activity.MAINTENANCE_WITHDRAWN, record, by)
        session.delete(record)
    else:
        _note(session, Activity.MAINTENANCE_ENDED, record, by)
        record.ended_at = record.updated_at = now
    session.flush()
    request_estimate(session, queue, camera_id)


def note_ends(session: Session, camera_id: str, now: datetime) -> bool:
    """Note the end of windows that came to it by themselves; says whether there was any."""
    over = references.maintenance_just_over(session, camera_id, now)
    for record in over:
        record.ended_at = record.to_at
        _note(session, Activity.MAINTENANCE_OVER, record, None)
    return bool(over)


def _note(session: Session, what: Activity, record: MaintenanceRecord, by: str | None) -> None:
    """Keep what was said of a window; its times as they are then."""
    note(
        session,
        what,
        by=by,
        camera_id=record.camera_id,
        subject_id=record.id,
        until=record.to_at,
        text=record.reason,
        details={"from": json_time(record.from_at), "to": json_time(record.to_at)},
    )


def _require(session: Session, camera_id: str, window_id: str) -> MaintenanceRecord:
    require_camera(session, camera_id)
    record = references.find_maintenance(session, camera_id, window_id)
    if record is None:
        raise NotFoundError(f"window_id: camera {camera_id!r} has no window {window_id!r}")
    return record


def _check(from_at: datetime, to_at: datetime, now: datetime, settings: Settings) -> None:
    """Refuse windows that are none, or that would blind a camera for good by a slip of a digit."""
    longest = timedelta(days=settings.maintenance_max_days)
    if to_at <= from_at:
        _refuse("to", f"a time after its beginning, {from_at.isoformat()}, is needed", to_at)
    if to_at - from_at > longest:
        _refuse("to", f"at most {longest.days} days after {from_at.isoformat()} are taken", to_at)
    if abs(from_at - now) > _FARTHEST:
        _refuse("from", f"at most {_FARTHEST.days} days from now are taken", from_at)


def _refuse(name: str, problem: str, got: datetime) -> None:
    raise MalformedError.of_field(name, f"{problem}, got {got.isoformat()}")
