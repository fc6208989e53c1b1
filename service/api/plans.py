"""`/cameras/{id}/plan`: an aerial picture or a floor plan, on which map points are shown."""

import math
from datetime import datetime
from typing import Annotated

from fastapi import APIRouter, Depends, Header, Query, Response

from service.api.middleware.dependencies import ReadDep, StateDep, WriteDep, WritesDep
from service.api.schemas import Out
from service.api.snapshots import IMAGE_ANSWER, IMAGE_BODY, jpeg_answer, read_body
from service.cameras import plans
from service.formats.still import Still


class PlanOut(Out):
    """What is known of a plan as it is kept.

    Of its pixel (p, q), integers at centres: metres right of its lower left corner are
    `metres_per_pixel` (p + 0.5), those up from there `metres_per_pixel` (`height` - q - 0.5). x is
    to the east and y to the north, which is `north_deg` clockwise from up.
    """

    sha256: str
    width: int
    height: int
    metres_per_pixel: float
    north_deg: float
    stored_at: datetime


router = APIRouter(prefix="/cameras/{camera_id}/plan", tags=["cameras"])


@router.put("", openapi_extra=IMAGE_BODY)
def put_plan(
    camera_id: str,
    still: Annotated[Still, Depends(read_body)],
    state: StateDep,
    write: WritesDep,
    metres_per_pixel: Annotated[
        float, Query(ge=1e-4, le=100, allow_inf_nan=False, description="of the picture as sent")
    ],
    north_deg: Annotated[
        float,
        Query(ge=-360, le=360, allow_inf_nan=False, description="of north, clockwise from up"),
    ] = 0.0,
) -> PlanOut:
    """Store a ground plan of a camera.

    The image, seen from above, replaces the former plan. It is stored without EXIF, at most 1920 px
    wide. Map points are shown on it.
    """
    with write(camera_id) as session:
        record = plans.put_plan(
            session, state.settings, camera_id, still, metres_per_pixel, north_deg
        )
        return PlanOut.of(record, north_deg=math.degrees(record.north_rad))


@router.get("", response_class=Response, responses=IMAGE_ANSWER)
def get_plan(
    camera_id: str,
    state: StateDep,
    session: ReadDep,
    if_none_match: Annotated[str | None, Header()] = None,
) -> Response:
    """Get the ground plan of a camera."""
    return jpeg_answer(plans.show_plan(session, state.settings, camera_id), if_none_match)


@router.delete("", status_code=204)
def delete_plan(camera_id: str, session: WriteDep) -> None:
    """Delete the ground plan of a camera.

    Map points that were marked on it are kept.
    """
    plans.remove_plan(session, camera_id)
