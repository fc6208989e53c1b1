"""A camera's still image: kept where the operator allows it, shown on its page, nowhere else."""

import hashlib
from datetime import UTC, datetime
from typing import Any

from sqlalchemy.orm import Session

from service.access.activity import note
from service.cameras.cameras import require_camera
from service.enums import Activity
from service.errors import (
    ConflictError,
    FieldError,
    MalformedError,
    NotFoundError,
    SwitchedOffError,
)
from service.estimate_queue import request_estimate
from service.formats.still import Still
from service.job_queue import JobQueue
from service.notifications.outbox import json_time
from service.settings import Settings
from service.store import cameras, pictures
from service.store.cameras import Image, SnapshotRecord
from service.store.pictures import PictureRecord

_OTHER_SHAPE = 0.01  # of the ratio of its sides


def require_snapshots(settings: Settings) -> None:
    """Refuse while pictures are not to be kept.

    Raises:
        SwitchedOffError: the setting says so.
    """
    if settings.snapshots == "off":
        raise SwitchedOffError(
            "snapshots: this service takes no pictures; SUREFOOT_SNAPSHOTS=pictures allows one a "
            "camera, SUREFOOT_SNAPSHOTS=features what is read of it"
        )


def put_snapshot(
    session: Session,
    queue: JobQueue,
    camera_id: str,
    still: Still,
    taken_at: datetime | None = None,
) -> SnapshotRecord:
    """Keep a still image of a camera in place of the one there was, and have it compared.

    Raises:
        NotFoundError: there is no such camera.
        ConflictError: there is a newer one.
        MalformedError: it is not of the camera's shape, so nothing would lie where it belongs.
    """
    camera = require_camera(session, camera_id)
    wanted, got = camera.width / camera.height, still.width / still.height
    if abs(got / wanted - 1) > _OTHER_SHAPE:
        reason = (
            f"an image of the camera's shape, {camera.width} x {camera.height}, is needed, "
            f"got {still.width} x {still.height}"
        )
        raise MalformedError(f"body: {reason}", (FieldError(pointer="", reason=reason),))
    now = datetime.now(UTC)
    taken_at = min(taken_at or now, now)  # a clock that is ahead makes no picture newer than now
    last_at = newest_at(session, camera_id)
    # One of the future was kept before the clock was set back.
    if last_at is not None and taken_at < last_at <= now:
        raise ConflictError(f"taken_at: a newer picture is kept, of {json_time(last_at)}")
    record = session.merge(
        SnapshotRecord(
            camera_id=camera_id,
            **columns_of(still),
            taken_at=taken_at,
            stored_at=now,
            compared_at=None,
        )
    )
    session.flush()
    request_estimate(session, queue, camera_id)
    details = {"sha256": record.sha256}
    note(session, Activity.SNAPSHOT_KEPT, by=None, camera_id=camera_id, details=details)
    return record


def columns_of(still: Still) -> dict[str, Any]:
    """A still image as the columns of any image of a camera."""
    digest = hashlib.sha256(still.jpeg).hexdigest()
    return dict(jpeg=still.jpeg, sha256=digest, width=still.width, height=still.height)


def show_snapshot(session: Session, settings: Settings, camera_id: str) -> SnapshotRecord:
    """The newest still image of a camera.

    Raises:
        NotFoundError: there is no such camera, or none of it is kept.
        SwitchedOffError: pictures are not to be kept any more.
    """
    require_camera(session, camera_id)
    require_snapshots(settings)
    record = session.get(SnapshotRecord, camera_id)
    if record is None:
        raise NotFoundError(f"snapshot: none is kept of camera {camera_id!r}")
    return record


def show_stood(session: Session, settings: Settings, camera_id: str) -> bytes:
    """The newest still image of a camera by which it stood at its prior pose.

    Raises:
        NotFoundError: there is no such camera, or none of it is kept.
        SwitchedOffError: pictures are not to be kept any more.
    """
    require_camera(session, camera_id)
    require_snapshots(settings)
    record = session.get(PictureRecord, camera_id)
    if record is None or record.stood_jpeg is None:
        raise NotFoundError(f"snapshot: none is kept of {camera_id!r} by which it stood")
    return record.stood_jpeg


def remove_snapshot(session: Session, camera_id: str) -> None:
    """Delete a camera's image and its features, whatever the settings are.

    Raises:
        NotFoundError: the camera does not exist, or neither image nor features of it are kept.
    """
    require_camera(session, camera_id)
    features = pictures.forget(session, camera_id)
    if not cameras.remove_image(session, SnapshotRecord, camera_id) and not features:
        raise NotFoundError(f"snapshot: neither image nor features of {camera_id!r} are kept")
    note(session, Activity.SNAPSHOT_REMOVED, by=None, camera_id=camera_id)


def image_facts(
    session: Session, settings: Settings, kind: type[Image], camera_id: str
) -> Image | None:
    """A camera's still image or plan, without reading it; None where none may be shown."""
    if settings.snapshots != "pictures":
        return None
    return cameras.image_facts(session, kind, camera_id)


def stood_at(session: Session, settings: Settings, camera_id: str) -> datetime | None:
    """The time of the newest picture by which a camera stood; None where none may be shown."""
    if settings.snapshots != "pictures":
        return None
    record = session.get(PictureRecord, camera_id)
    return None if record is None else record.stood_at


def newest_at(session: Session, camera_id: str) -> datetime | None:
    """The time of a camera's newest picture, kept or compared; None where there is none."""
    kept = cameras.image_facts(session, SnapshotRecord, camera_id)
    compared = session.get(PictureRecord, camera_id)
    times = [each.taken_at for each in (kept, compared) if each is not None]
    return max(times, default=None)
