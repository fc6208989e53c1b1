"""The plan of what a camera sees, from above: places on it are the metres of map points."""

import math
from datetime import UTC, datetime

from sqlalchemy.orm import Session

from service.access.activity import note
from service.cameras.cameras import require_camera
from service.cameras.snapshots import columns_of
from service.enums import Activity
from service.errors import NotFoundError, SwitchedOffError
from service.formats.still import Still
from service.settings import Settings
from service.store import cameras
from service.store.cameras import PlanRecord


def put_plan(
    session: Session,
    settings: Settings,
    camera_id: str,
    still: Still,
    metres_per_pixel: float,
    north_deg: float,
) -> PlanRecord:
    """Keep a plan in place of the one there was.

    Args:
        session: of a store.
        settings: of the service.
        camera_id: of the camera.
        still: the plan.
        metres_per_pixel: of what was sent, before it was made smaller.
        north_deg: the direction of north on it, clockwise from up.

    Raises:
        NotFoundError: there is no such camera.
        SwitchedOffError: pictures are not to be kept.
    """
    require_camera(session, camera_id)
    _require_pictures(settings)
    record = session.merge(
        PlanRecord(
            camera_id=camera_id,
            **columns_of(still),
            metres_per_pixel=metres_per_pixel * still.sent_width / still.width,
            north_rad=math.radians(north_deg),
            stored_at=datetime.now(UTC),
        )
    )
    session.flush()
    note(
        session, Activity.PLAN_KEPT, by=None, camera_id=camera_id, details={"sha256": record.sha256}
    )
    return record


def show_plan(session: Session, settings: Settings, camera_id: str) -> bytes:
    """The plan of a camera, a JPEG.

    Raises:
        NotFoundError: there is no such camera, or no plan of it is kept.
        SwitchedOffError: pictures are not to be kept any more.
    """
    require_camera(session, camera_id)
    _require_pictures(settings)
    record = session.get(PlanRecord, camera_id)
    if record is None:
        raise _none_kept(camera_id)
    return record.jpeg


def remove_plan(session: Session, camera_id: str) -> None:
    """Delete the plan of a camera; allowed whatever the settings are.

    Raises:
        NotFoundError: there is no such camera, or no plan of it is kept.
    """
    require_camera(session, camera_id)
    if not cameras.remove_image(session, PlanRecord, camera_id):
        raise _none_kept(camera_id)
    note(session, Activity.PLAN_REMOVED, by=None, camera_id=camera_id)


def _require_pictures(settings: Settings) -> None:
    if settings.snapshots != "pictures":
        raise SwitchedOffError(
            "snapshots: this service keeps no pictures, and no plans; SUREFOOT_SNAPSHOTS=pictures "
            "allows both"
        )


def _none_kept(camera_id: str) -> NotFoundError:
    return NotFoundError(f"plan: none is kept of camera {camera_id!r}")
