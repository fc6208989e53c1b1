"""`/cameras/{id}/ground` and `/image`: pixels to places on the ground and back, with ellipses."""

from collections.abc import Sequence
from datetime import datetime
from typing import Annotated, Self

import msgspec
import numpy as np
from fastapi import APIRouter, Response
from pydantic import BaseModel, Field

from models.geometry.rotation import Array
from service.api.ignored import NamingRoute
from service.api.middleware.dependencies import ReadDep
from service.api.schemas import POSE_FIELDS, Body, Finite, Moment, PoseOut
from service.cameras.cameras import require_camera
from service.cameras.ground import pixels_of_places, places_of_pixels
from service.cameras.held_poses import HeldPose, held_pose

_MOST_POINTS = 10_000  # 10 MB of an answer
_JSON = "application/json"
_Pixel = Annotated[Finite, Field(ge=-1e7, le=1e7)]
_Metres = Annotated[Finite, Field(ge=-1e8, le=1e8)]
_At = Annotated[Moment | None, Field(description="the time that it is of; now, if unsaid")]


class PixelsBody(Body):
    """Pixels [u, v] of feet."""

    points: list[Annotated[list[_Pixel], Field(min_length=2, max_length=2)]] = Field(
        max_length=_MOST_POINTS
    )
    at: _At = None


class PlacesBody(Body):
    """Places [x, y] on the ground in metres."""

    points: list[Annotated[list[_Metres], Field(min_length=2, max_length=2)]] = Field(
        max_length=_MOST_POINTS
    )
    at: _At = None


class PlaceOut(BaseModel):
    """A place on the ground.

    `sd_m`: semi-axes of its one-sd ellipse, the major first, and the major's direction in degrees
    clockwise from +Y.
    """

    x_m: float
    y_m: float
    sd_m: list[float] | None


class PixelOut(BaseModel):
    """A pixel, maybe outside the picture.

    `sd_px`: semi-axes of its one-sd ellipse, the major first, and the major's direction in degrees
    clockwise from +u.
    """

    u: float
    v: float
    sd_px: list[float] | None


class HeldPoseOut(BaseModel):
    """A pose that held `since` a time.

    Ellipses are of the numbers in `estimated`; the others are the prior pose's. If the camera
    has `drifted` and none is estimated, its position is unknown. `pose` is null if no pose has
    been confirmed.
    """

    drifted: bool
    since: datetime
    estimated: list[str]
    pose: PoseOut | None

    @classmethod
    def from_value(cls, held: HeldPose) -> Self:
        """The body of a pose that held."""
        return cls(
            drifted=held.drifted,
            since=held.since,
            estimated=[field for name, field in POSE_FIELDS.items() if name in held.identifiable],
            pose=None if held.assumed else PoseOut.from_value(held.pose),
        )


class PlacesOut(BaseModel):
    """Places in the order of the pixels, null above the horizon, and the pose that they are by."""

    points: list[PlaceOut | None]
    by: HeldPoseOut


class PixelsOut(BaseModel):
    """Pixels in the order of the places, null behind the camera, and the pose that they are by."""

    points: list[PixelOut | None]
    by: HeldPoseOut


router = APIRouter(prefix="/cameras/{camera_id}", tags=["pose"], route_class=NamingRoute)

# As the bodies above, in a tenth of the time: ten thousand models are as many objects to collect.
_Place = msgspec.defstruct("_Place", ["x_m", "y_m", "sd_m"], gc=False)
_Seen = msgspec.defstruct("_Seen", ["u", "v", "sd_px"], gc=False)
_Ellipse = msgspec.defstruct("_Ellipse", ["major", "minor", "angle"], array_like=True, gc=False)


@router.post("/ground", response_model=PlacesOut)
def map_pixels_to_ground(camera_id: str, body: PixelsBody, session: ReadDep) -> Response:
    """Map pixels to the ground.

    The pose that held at the given time is used. Each place has its error ellipse.
    """
    lens = require_camera(session, camera_id).intrinsics
    held = held_pose(session, camera_id, body.at)
    return _answer(_Place, held, *places_of_pixels(lens, held, _array(body.points)))


@router.post("/image", response_model=PixelsOut)
def map_ground_to_pixels(camera_id: str, body: PlacesBody, session: ReadDep) -> Response:
    """Map places on the ground to pixels.

    The pose that held at the given time is used.
    """
    lens = require_camera(session, camera_id).intrinsics
    held = held_pose(session, camera_id, body.at)
    return _answer(_Seen, held, *pixels_of_places(lens, held, _array(body.points)))


def _array(points: list[list[float]]) -> Array:
    return np.array(points, dtype=np.float64).reshape(-1, 2)


def _answer(kind: type, held: HeldPose, found: Array, ellipses: Array | None) -> Response:
    """Points with their ellipses: null where there is none, at the very horizon for instance."""
    sds: Sequence[object] = [None] * len(found)
    if ellipses is not None:
        known: list[bool] = np.isfinite(ellipses).all(axis=1).tolist()  # type: ignore[assignment]
        ellipses = np.column_stack([ellipses[:, :2], np.degrees(ellipses[:, 2])])
        rows = zip(*ellipses.T.tolist(), known, strict=True)
        sds = [_Ellipse(a, b, angle) if fine else None for a, b, angle, fine in rows]
    placed: list[bool] = np.isfinite(found).all(axis=1).tolist()  # type: ignore[assignment]
    points = [
        kind(first, second, sd) if seen else None
        for first, second, sd, seen in zip(*found.T.tolist(), sds, placed, strict=True)
    ]
    by = HeldPoseOut.from_value(held).model_dump(mode="json")
    return Response(msgspec.json.encode({"points": points, "by": by}), media_type=_JSON)
