"""Zones follow their camera: kept as they were drawn, told as they are by the pose that holds."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from typing import Any

import numpy as np
from sqlalchemy.orm import Session

from models.geometry.intrinsics import Intrinsics
from models.geometry.outlines import MovedOutline, View, moved_outlines, within_picture
from models.geometry.pose import PARAMETERS
from models.geometry.rotation import Array
from service.access.activity import note
from service.cameras.cameras import require_camera
from service.cameras.held_poses import HeldPose, drawn_since_move, held_pose
from service.enums import Activity, ZoneOn
from service.errors import MalformedError, check_version
from service.formats.zone_formats import ZoneFormat, is_cut, read_zones, write_zones
from service.formats.zones import Corner, Zone
from service.store import zones
from service.store.cameras import PriorPoseRecord
from service.store.zones import ZonesRecord


@dataclass(frozen=True, slots=True, kw_only=True)
class ZoneView:
    """A zone as it was drawn, and where it is `now`."""

    zone: Zone
    now: MovedOutline


@dataclass(frozen=True, slots=True, kw_only=True)
class ZonesView:
    """The zones of a camera by the pose that holds; `record` is None where none were ever drawn.

    They have `moved` where that pose or the lens is another than at the drawing; the camera's
    centre is `shift_m` from where it was.
    """

    camera_id: str
    record: ZonesRecord | None
    intrinsics: Intrinsics
    held: HeldPose
    zones: tuple[ZoneView, ...]
    moved: bool
    shift_m: float

    @property
    def etag(self) -> str:
        """Changes whenever zones are drawn."""
        return _etag(self.camera_id, self.record)


def view_zones(session: Session, camera_id: str) -> ZonesView:
    """The zones of a camera, where they were drawn and where they are.

    Raises:
        NotFoundError: there is no such camera.
    """
    lens = require_camera(session, camera_id).intrinsics
    record, held = zones.of_camera(session, camera_id), held_pose(session, camera_id)
    now = View(intrinsics=lens, pose=held.pose)
    drawn = now if record is None else record.view
    if held.assumed:  # nobody knows a pose that it could have left
        now = View(intrinsics=lens, pose=drawn.pose)
    moved = drawn != now
    covariance = None if record is None else _between(session, record, held, moved=moved)
    outlines = [] if record is None else list(record.outlines.values())
    placed = moved_outlines(outlines, now, covariance)
    if not moved:
        placed = [
            _unmoved(outline.corners, each) for outline, each in zip(outlines, placed, strict=True)
        ]
    drawn_zones = () if record is None else zones_of_record(record)
    return ZonesView(
        camera_id=camera_id,
        record=record,
        intrinsics=lens,
        held=held,
        zones=tuple(
            ZoneView(zone=zone, now=each) for zone, each in zip(drawn_zones, placed, strict=True)
        ),
        moved=moved,
        shift_m=float(np.linalg.norm(now.pose.centre_m - drawn.pose.centre_m)),
    )


def draw_zones(
    session: Session,
    camera_id: str,
    etag: str | None,
    kind: ZoneFormat | None,
    document: Any,
    on: ZoneOn,
    at: datetime | None,
) -> ZonesView:
    """Replace the zones of a camera.

    Args:
        session: of a store.
        camera_id: the camera.
        etag: the version that the client read; not needed for the first zones.
        kind: the format of the document; None is our own JSON.
        document: as `read_document` made it.
        on: surface of zones that do not name one.
        at: when they were drawn, by the pose that held then; None is now.

    Raises:
        NotFoundError: unknown camera.
        MalformedError: the document has no usable zones.
        PreconditionFailedError: the zones changed since the client read them.
        PreconditionRequiredError: the camera has zones and `etag` is None.
    """
    lens = require_camera(session, camera_id).intrinsics
    record = zones.of_camera(session, camera_id)
    if record is not None or etag is not None:  # otherwise no zones can be overwritten
        check_version("the zones are", _etag(camera_id, record), etag)
    drawn = read_zones(kind, document, (lens.width, lens.height), on)
    for zone in drawn:
        _check_seen(zone, lens)
    held, now = held_pose(session, camera_id, at), datetime.now(UTC)
    own = held.own if held.drifted else None
    session.merge(
        ZonesRecord(
            camera_id=camera_id,
            prior_pose_id=held.prior_pose_id,
            zones=[asdict(zone) for zone in drawn],
            form=kind,
            document=None if kind is None else document,
            intrinsics=asdict(lens),
            pose=asdict(held.pose),
            covariance=None if own is None else own.tolist(),
            version=1 if record is None else record.version + 1,
            drawn_at=at or now,
            updated_at=now,
        )
    )
    details = {"zones": len(drawn)}
    note(session, Activity.ZONES_DRAWN, by=None, camera_id=camera_id, details=details)
    session.flush()
    return view_zones(session, camera_id)


def zones_document(view: ZonesView, kind: ZoneFormat) -> str:
    """The zones in a format: the document that came in it, its corners where they are now."""
    record, lens = view.record, view.intrinsics
    own = record is not None and record.form == kind
    moved = {each.zone.id: _shown(view, each, kind) for each in view.zones}
    return write_zones(
        kind,
        record.document if record is not None and own else None,
        (lens.width, lens.height),
        [each.zone for each in view.zones],
        moved if view.moved else None,
    )


def zones_of_record(record: ZonesRecord) -> Sequence[Zone]:
    """The zones of a record."""
    return [
        Zone(id=each["id"], on=ZoneOn(each["on"]), corners=tuple(map(tuple, each["corners"])))
        for each in record.zones
    ]


def _shown(view: ZonesView, each: ZoneView, kind: ZoneFormat) -> Sequence[Corner]:
    """The corners of a zone now, of which a format may take none outside the picture."""
    corners = each.now.corners
    if is_cut(kind) and len(corners):
        corners = within_picture(corners, view.intrinsics, closed=len(each.zone.corners) > 2)
    return [(u, v) for u, v in corners.tolist()]


def _unmoved(corners: Array, placed: MovedOutline) -> MovedOutline:
    """A zone that is where it was, to the last digit; one above the horizon has no ellipses."""
    same = len(placed.corners) == len(corners)
    ellipses = placed.ellipses if same else None
    return replace(placed, corners=corners, ellipses=ellipses, overlap=1.0)


def _check_seen(zone: Zone, lens: Intrinsics) -> None:
    beyond = lens.beyond(np.array(zone.corners, dtype=np.float64))
    if beyond.any():
        corner = zone.corners[int(np.argmax(beyond))]
        raise MalformedError.of_field("zones", f"{zone.id}: {lens.beyond_words}, got {corner}")


def _between(session: Session, record: ZonesRecord, held: HeldPose, *, moved: bool) -> Array | None:
    """The covariance of a pose relative to that of a drawing; None if none is known.

    The errors of an earlier prior pose and of today's count as independent, which at worst counts
    the first one twice.
    """
    parts = [held.own]
    if moved:
        parts.append(None if record.covariance is None else np.array(record.covariance))
    if record.prior_pose_id != held.prior_pose_id:
        drawn_at = session.get_one(PriorPoseRecord, record.prior_pose_id).covariance
        parts += [held.prior, None if drawn_at is None else np.array(drawn_at)]
    known = [each for each in parts if each is not None]
    if not known:
        return None
    if drawn_since_move(record, held):
        # What the tracks do not determine is the same as at the drawing.
        told = np.isin(PARAMETERS, held.identifiable)
        known = [np.where(np.outer(told, told), each, 0.0) for each in known]
    return sum(known[1:], known[0])


def _etag(camera_id: str, record: ZonesRecord | None) -> str:
    return f'"{camera_id}-zones-{0 if record is None else record.version}"'
