"""A camera's still image: kept where the operator allows it, shown on its page, nowhere else."""

import hashlib
from datetime import UTC, datetime

from sqlalchemy.orm import Session, defer

from service.access.activity import note
from service.cameras.cameras import require_camera
from service.enums import Activity
from service.errors import FieldError, MalformedError, NotFoundError, SwitchedOffError
from service.formats.still import Still
from service.settings import Settings
from service.store import cameras
from service.store.cameras import SnapshotRecord

_OTHER_SHAPE = 0.01  # of the ratio of its sides


def require_snapshots(settings: Settings) -> None:
    """Refuse while pictures are not to be kept.

    Raises:
        SwitchedOffError: the setting says so.
    """
    if not settings.snapshots:
        raise SwitchedOffError(
            "snapshots: this service keeps no pictures; SUREFOOT_SNAPSHOTS=true allows one a camera"
        )


def put_snapshot(session: Session, camera_id: str, still: Still) -> SnapshotRecord:
    """Keep a still image of a camera in place of the one there was.

    Raises:
        NotFoundError: there is no such camera.
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
    digest = hashlib.sha256(still.jpeg).hexdigest()
    now = datetime.now(UTC)
    record = session.merge(
        SnapshotRecord(
            camera_id=camera_id,
            jpeg=still.jpeg,
            sha256=digest,
            width=still.width,
            height=still.height,
            stored_at=now,
        )
    )
    note(session, Activity.SNAPSHOT_KEPT, by=None, camera_id=camera_id, details={"sha256": digest})
    return record


def show_snapshot(session: Session, settings: Settings, camera_id: str) -> SnapshotRecord:
    """The still image of a camera.

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


def remove_snapshot(session: Session, camera_id: str) -> None:
    """Delete the still image of a camera; allowed whatever the settings are.

    Raises:
        NotFoundError: there is no such camera, or none of it is kept.
    """
    require_camera(session, camera_id)
    if not cameras.remove_snapshot(session, camera_id):
        raise NotFoundError(f"snapshot: none is kept of camera {camera_id!r}")
    note(session, Activity.SNAPSHOT_REMOVED, by=None, camera_id=camera_id)


def snapshot_facts(session: Session, settings: Settings, camera_id: str) -> SnapshotRecord | None:
    """Size and time of a camera's still image, without reading it; None where none may be shown."""
    if not settings.snapshots:
        return None
    return session.get(SnapshotRecord, camera_id, options=(defer(SnapshotRecord.jpeg),))
