"""`/cameras/{id}/zones`: kept as they were drawn, told where they are by the pose that holds."""

from datetime import datetime
from typing import Annotated, Any, Self

import numpy as np
from fastapi import APIRouter, Query, Request, Response
from pydantic import BaseModel

from service.api.documented import ETAG
from service.api.ground import HeldPoseOut
from service.api.ignored import NamingRoute
from service.api.middleware.dependencies import (
    BodyDep,
    IfMatch,
    ReadDep,
    StateDep,
    WriteDep,
    media_type_of,
)
from service.api.schemas import Moment
from service.cameras import zones
from service.cameras.zones import ZonesView, ZoneView
from service.enums import ZoneOn
from service.errors import UnsupportedMediaTypeError
from service.formats.zone_formats import (
    AXIS_TYPE,
    GEOJSON_TYPE,
    JSON_TYPE,
    YAML_TYPE,
    ZoneFormat,
    file_name,
    format_of,
    media_type_of_zones,
    read_document,
)
from service.formats.zones import MOST_CORNERS, MOST_ZONES
from service.setting_values import read_camera_names
from surefoot.bridge.camera_names import camera_id_of

_DIGITS = 3  # of a pixel
_TYPES = (JSON_TYPE, GEOJSON_TYPE, AXIS_TYPE, YAML_TYPE)


class ZoneOut(BaseModel):
    """A zone as it was drawn (`points`) and where it is (`points_now`), in pixels.

    `points_now` may be outside the picture, and is empty where all of it is behind the camera or
    beyond the horizon. `sd_px`, a corner: semi-axes of its one-sd ellipse, and the direction of the
    major one in degrees clockwise from +u. `in_view` is the share that the picture shows, `overlap`
    the share that still lies where it was drawn.
    """

    id: str
    on: ZoneOn
    points: list[list[float]]
    points_now: list[list[float]]
    sd_px: list[list[float] | None]
    in_view: float
    overlap: float

    @classmethod
    def from_value(cls, view: ZoneView, *, moved: bool) -> Self:
        """The body of a zone; to the last digit as it came where nothing has moved."""
        points = [list(corner) for corner in view.zone.corners]
        now = np.round(view.now.corners, _DIGITS).tolist() if moved else points
        return cls(
            id=view.zone.id,
            on=view.zone.on,
            points=points,
            points_now=now,
            sd_px=_ellipses(view, len(now)),
            in_view=view.now.in_view,
            overlap=view.now.overlap,
        )


class ZonesOut(BaseModel):
    """Zones, the pose that they are told by, and when they were drawn, if ever.

    `shift_m`: how far the camera's centre is from where it was at the drawing, by which near things
    that are not on the ground are elsewhere than told.
    """

    zones: list[ZoneOut]
    moved: bool
    shift_m: float
    drawn_at: datetime | None
    by: HeldPoseOut

    @classmethod
    def from_value(cls, view: ZonesView) -> Self:
        """The body of zones."""
        return cls(
            zones=[ZoneOut.from_value(each, moved=view.moved) for each in view.zones],
            moved=view.moved,
            shift_m=view.shift_m,
            drawn_at=None if view.record is None else view.record.drawn_at,
            by=HeldPoseOut.from_value(view.held),
        )


def _ellipses(view: ZoneView, count: int) -> list[list[float] | None]:
    found = view.now.ellipses
    if found is None:
        return [None] * count
    degrees = np.mod(np.degrees(found[:, 2]), 180.0)
    rows = np.round(np.column_stack([found[:, :2], degrees]), _DIGITS)
    return [row.tolist() if np.isfinite(row).all() else None for row in rows]


router = APIRouter(prefix="/cameras/{camera_id}/zones", tags=["zones"], route_class=NamingRoute)

_POINT = {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2}
_ZONE: dict[str, Any] = {
    "type": "object",
    "required": ["id", "points"],
    "properties": {
        "id": {"type": "string", "minLength": 1, "maxLength": 100},
        "on": {"type": "string", "enum": list(ZoneOn)},
        "points": {"type": "array", "items": _POINT, "minItems": 2, "maxItems": MOST_CORNERS},
    },
}
_OURS = {
    "type": "object",
    "required": ["zones"],
    "properties": {
        "zones": {"type": "array", "items": _ZONE, "maxItems": MOST_ZONES},
        "size": {
            **_POINT,
            "description": "width and height in pixels of the image that `points` are of",
        },
        "normalised": {"type": "boolean", "description": "`points` are shares of the image"},
    },
}
_DESCRIBED_BODY = {
    "requestBody": {
        "required": True,
        "content": {
            JSON_TYPE: {"schema": _OURS},
            GEOJSON_TYPE: {"schema": {"type": "object"}},
            AXIS_TYPE: {"schema": {"type": "object"}},
            YAML_TYPE: {"schema": {"type": "string"}},
        },
    }
}
_Format = Annotated[
    ZoneFormat | None,
    Query(alias="format", description="of another system; else our JSON, in pixels"),
]


_FILES: dict[str, Any] = {kind: {} for kind in sorted(_TYPES)}


@router.get("", response_model=ZonesOut, responses={200: {"content": _FILES}})
def get_zones(
    camera_id: str, session: ReadDep, response: Response, format_: _Format = None
) -> ZonesOut | Response:
    """Get the zones of a camera.

    Each is as drawn and at its current place. With `format`, the answer is a configuration for
    another system with the corrected zones.
    """
    view = zones.view_zones(session, camera_id)
    headers = {"ETag": view.etag}
    if format_ is None:
        response.headers.update(headers)
        return ZonesOut.from_value(view)
    name = file_name(format_, camera_id)
    headers["Content-Disposition"] = f'attachment; filename="{name}"'
    content = zones.zones_document(view, format_)
    return Response(content, media_type=media_type_of_zones(format_), headers=headers)


@router.put("", openapi_extra=_DESCRIBED_BODY, responses={200: {"headers": ETAG}})
def put_zones(
    camera_id: str,
    request: Request,
    body: BodyDep,
    session: WriteDep,
    state: StateDep,
    response: Response,
    if_match: IfMatch = None,
    format_: _Format = None,
    on: Annotated[ZoneOn, Query(description="of zones that do not say it")] = ZoneOn.GROUND,
    drawn_at: Annotated[
        Moment | None, Query(description="when they were drawn, by the pose that held; now")
    ] = None,
) -> ZonesOut:
    """Replace the zones of a camera.

    The body is our JSON, GeoJSON, or a configuration of Frigate or Axis. The media type selects the
    format; for `application/json`, `format` does. The first zones need no `If-Match`.
    """
    media_type = media_type_of(request)
    if media_type not in _TYPES:
        raise UnsupportedMediaTypeError(
            f"Content-Type: one of {', '.join(_TYPES)} is needed, got {media_type or 'none'}"
        )
    kind = format_of(format_, media_type)
    names = read_camera_names(state.settings.mqtt_cameras)
    document = read_document(
        kind, body, media_type, camera_id, lambda name: camera_id_of(name, names)
    )
    view = zones.draw_zones(session, camera_id, if_match, kind, document, on, drawn_at)
    response.headers["ETag"] = view.etag
    return ZonesOut.from_value(view)
