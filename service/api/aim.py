"""`/cameras/{id}/aim`: where to turn a camera, requested each second by the person who turns it."""

import math
from datetime import datetime
from typing import Self

from fastapi import APIRouter, Request
from pydantic import BaseModel

from service.api.middleware.dependencies import BodyDep, StateDep, media_type_of
from service.cameras.aiming import Aim, aim_by_people, aim_by_picture, aim_target
from service.cameras.image_source import fetch_image
from service.errors import MalformedError
from service.formats.still import read_still
from service.notifications.fetch import FetchError

router = APIRouter(prefix="/cameras/{camera_id}/aim", tags=["pose"])


class AimOut(BaseModel):
    """How far to turn it right, up and clockwise, as it sees it; null where nothing tells.

    `by_picture` of now, or by the newest people, who take minutes. `good` within 0.2 deg.
    """

    right_deg: float | None
    up_deg: float | None
    clockwise_deg: float | None
    good: bool
    by_picture: bool
    at: datetime | None

    @classmethod
    def of(cls, aim: Aim | None) -> Self:
        """The body of an aim."""
        if aim is None:
            nothing = dict.fromkeys(("right_deg", "up_deg", "clockwise_deg", "at"))
            return cls(**nothing, good=False, by_picture=True)
        return cls(
            right_deg=math.degrees(aim.right_rad),
            up_deg=math.degrees(aim.up_rad),
            clockwise_deg=math.degrees(aim.clockwise_rad),
            good=aim.good,
            by_picture=aim.by_picture,
            at=aim.at,
        )


_IMAGE = {"schema": {"type": "string", "format": "binary"}}
_DESCRIBED_BODY = {
    "requestBody": {"required": False, "content": {"image/jpeg": _IMAGE, "image/png": _IMAGE}}
}


# Shorter than the wait for a turn, so that silent cameras delay the aim of another one only once.
_FETCH_S = 4.0


@router.post("", openapi_extra=_DESCRIBED_BODY)
def get_aiming_directions(
    camera_id: str, request: Request, body: BodyDep, state: StateDep
) -> AimOut:
    """Get the directions for turning a camera back.

    The input is the image that is sent or fetched from `snapshot_url`; without an image, the newest
    tracks. The image is not stored. A camera takes one such request at a time.
    """
    settings = state.settings
    with state.store.read() as session:
        target = aim_target(session, camera_id)
        off = settings.snapshots == "off"
        if off or not target.gallery or not (body or target.snapshot_url):
            return AimOut.of(aim_by_people(session, settings, camera_id))
    media_type = media_type_of(request)
    if not body:
        try:
            found = fetch_image(state.store, settings, camera_id, state.image_hosts, _FETCH_S)
        except FetchError as error:
            raise MalformedError(f"snapshot_url: {error}") from error
        body, media_type = found.content, found.media_type
    with state.stills.turn(settings.http_wait_s):
        return AimOut.of(aim_by_picture(target, read_still(body, media_type)))
