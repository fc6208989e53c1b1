"""`POST /cameras/{id}/tracks` in all its forms."""

import json
import time
from collections.abc import Callable, Coroutine
from contextlib import nullcontext
from dataclasses import dataclass
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Query, Request, Response
from fastapi.concurrency import run_in_threadpool
from fastapi.routing import APIRoute
from pydantic import Field

from service.access.tokens import Caller
from service.api.middleware.dependencies import (
    AppState,
    BodyDep,
    CallerDep,
    StateDep,
    get_caller,
    media_type_of,
)
from service.api.schemas import Out
from service.cameras import tracks
from service.errors import MalformedError, ServiceError, UnsupportedMediaTypeError
from service.formats import batch as formats
from service.formats.batch import DEFAULT_SOURCE
from service.formats.scaling import image_sizes_of, read_size
from service.formats.track import Batch, Clock, Limits
from service.formats.track_text import people_classes, read_text
from service.store.cameras import Picture
from surefoot.people import PEDESTRIANS


def _rows(what: str, numbers: int) -> dict[str, Any]:
    row = {"type": "array", "items": {"type": "number"}, "minItems": numbers}
    return {"type": "array", "items": row, "description": what}


# A track takes one of the four forms.
_SIZE: dict[str, Any] = {
    "size": {
        "type": "array",
        "items": {"type": "number", "exclusiveMinimum": 0},
        "minItems": 2,
        "maxItems": 2,
        "description": "[width, height] of the picture that the numbers are of, "
        "where that is not the camera's own",
    },
    "normalised": {
        "type": "boolean",
        "description": "true: the numbers are shares of the picture, 0 to 1",
    },
}
DESCRIBED_TRACK: dict[str, Any] = {
    "type": "object",
    "required": ["id"],
    "properties": {
        "id": {"type": "string"},
        "points": _rows(
            "[time_s, u_px, v_px] of the foot, or all with their heads: "
            "[time_s, u_px, v_px, u_head_px, v_head_px]",
            3,
        ),
        "boxes": _rows("[time_s, x1, y1, x2, y2] in pixels", 5),
        "frames": _rows("[frame, u_px, v_px], or all with their heads", 3),
        "frame_boxes": _rows("[frame, x1, y1, x2, y2]", 5),
        "class": {
            "type": ["string", "number", "null"],
            "description": "name or COCO number from 0; a track that is no person is skipped",
        },
        "confidence": {
            "type": ["number", "null"],
            "description": "0 marks a track to be ignored: it is skipped",
        },
        **_SIZE,
    },
}


class RejectionOut(Out):
    """Why a track was not stored."""

    index: int
    id: str | None = Field(validation_alias="track_id")
    code: str
    detail: str


class ReceiptOut(Out):
    """Counts of the posted tracks.

    `skipped` counts tracks by reason: `not_a_person`, `ignored_by_confidence`, `no_track_id`.
    `detail` explains an answer in which all tracks were skipped. `ignored` names unknown fields;
    of a body over 1 MiB, the first of the body and of each track.
    """

    accepted: int
    duplicates: int
    rejected: list[RejectionOut] = Field(validation_alias="rejections")
    skipped: dict[str, int] = Field(default_factory=dict)
    detail: str | None = None
    ignored: list[str] = Field(default_factory=list)


_LARGE = 256 * 1024  # bytes; several that are read at once would only keep each other up

_DESCRIBED_BODY = {
    "requestBody": {
        "required": True,
        "content": {
            "application/json": {
                "schema": {
                    "type": "object",
                    "required": ["tracks"],
                    "properties": {
                        "source": {"type": "string"},
                        "frame_rate_hz": {"type": "number"},
                        "started_at": {"type": "string", "format": "date-time"},
                        **_SIZE,
                        "tracks": {"type": "array", "items": DESCRIBED_TRACK},
                    },
                }
            },
            "application/x-ndjson": {"schema": {"type": "string"}},
            "text/csv": {"schema": {"type": "string"}},
        },
    }
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Posted:
    """A request as it came, unread."""

    body: bytes
    media_type: str
    source: str = DEFAULT_SOURCE
    frame_rate_hz: float | None = None
    started_at: str | None = None
    classes: str | None = None
    layout: str | None = None
    size: str | None = None
    normalised: bool | None = None


async def posted(
    request: Request,
    body: BodyDep,
    source: Annotated[str, Query(min_length=1, max_length=200)] = DEFAULT_SOURCE,
    frame_rate_hz: Annotated[float | None, Query(gt=0, le=1000)] = None,
    started_at: str | None = None,
    classes: Annotated[
        str | None,
        Query(description="classes of people, numbers or names: `0`, `1,7` or `person`"),
    ] = None,
    layout: Annotated[
        str | None,
        Query(
            description="text/csv: `mot`, `mot-gt`, `cvat`, `boxmot`, `conf-last`, `mcmot`, "
            "`visdrone`, `corners`, `corners-size`, `kitti`, `sdd`, `towncentre`, `aicity`, or a "
            "list of columns such as `frame,id,x1,y1,x2,y2,conf`"
        ),
    ] = None,
    size: Annotated[
        str | None, Query(description="width,height of the image that the numbers refer to")
    ] = None,
    normalised: Annotated[bool | None, Query(description="numbers are shares, 0 to 1")] = None,
) -> Posted:
    """A request, to be read in the route's own thread."""
    return Posted(
        body=body,
        media_type=media_type_of(request),
        source=source,
        frame_rate_hz=frame_rate_hz,
        started_at=started_at,
        classes=classes,
        layout=layout,
        size=size,
        normalised=normalised,
    )


def read_batch(state: AppState, camera: Picture, came: Posted) -> Batch:
    """The tracks of a request of a camera with such pictures, read while no session is open.

    Raises:
        UnsupportedMediaTypeError: neither JSON, NDJSON nor CSV.
        OverloadedError: other large bodies are being read all the time.
    """
    source = formats.read_source(came.source)
    classes = None if came.classes is None else people_classes(came.classes)
    limits = Limits(
        width=camera.width,
        height=camera.height,
        now_s=time.time(),
        max_ahead_s=state.settings.max_ahead_s,
        fisheye=camera.fisheye,
        classes=classes or PEDESTRIANS,
        image_sizes=image_sizes_of(json.loads(camera.image_sizes or "null")),
    )
    try:
        size = None if came.size is None else read_size(came.size)
        limits = limits.of_size(size, came.normalised)
    except ValueError as error:
        raise MalformedError.of_field(*str(error).split(": ", 1)) from error
    started_at_s = None
    if came.started_at is not None:
        started_at_s = formats.read_time(came.started_at)
    clock = Clock(
        frame_rate_hz=came.frame_rate_hz or camera.frame_rate_hz, started_at_s=started_at_s
    )
    large = len(came.body) > _LARGE
    with state.large_bodies.turn(state.settings.http_wait_s) if large else nullcontext():
        if came.media_type == "application/json":
            return formats.read_json(came.body, clock, limits)
        if came.media_type == "application/x-ndjson":
            return formats.read_ndjson(came.body, source, clock, limits)
        if came.media_type == "text/csv":
            return read_text(came.body, source, clock, limits, layout=came.layout, classes=classes)
    raise UnsupportedMediaTypeError(
        "Content-Type: application/json, application/x-ndjson or text/csv is needed, "
        f"got {came.media_type or 'none'}"
    )


def _take(state: AppState, camera_id: str, came: Posted, caller: Caller | None) -> Response:
    camera = state.pictures.of(state.store, camera_id)
    try:
        receipt = _stored(state, camera_id, camera, came, caller)
    except ServiceError as error:
        state.posts.note_error(camera_id, error)
        raise
    state.posts.note(camera_id, receipt)
    body = ReceiptOut.model_validate(receipt).model_dump_json(exclude_defaults=True)
    return Response(body, 202, media_type="application/json")


def _stored(
    state: AppState, camera_id: str, camera: Picture, came: Posted, caller: Caller | None
) -> tracks.Receipt:
    while True:
        try:
            return _store(state, camera_id, camera, came, caller)
        except (MalformedError, tracks.StalePictureError) as error:
            # It may be that the picture is another than when it was last asked for.
            now = state.pictures.again(state.store, camera_id)
            if now == camera and isinstance(error, MalformedError):
                raise
            camera = now


def _store(
    state: AppState, camera_id: str, camera: Picture, came: Posted, caller: Caller | None
) -> tracks.Receipt:
    batch = read_batch(state, camera, came)
    state.quota.check(state.store, camera_id, batch)
    with state.store.change(camera_id) as connection:
        return tracks.receive_tracks(
            connection,
            state.queue,
            camera_id,
            batch,
            read_by=camera,
            max_sources=state.settings.max_sources,
            watched=camera_id in state.watched,
            caller=caller,
        )


class _PostRoute(APIRoute):
    """A route that answers a request without a query without FastAPI's reading of it.

    Parameters, and the answer's check against its own schema, are a sixth of the CPU of a post of
    ten tracks (`tests/benchmarks/requests.py`).
    """

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """The handler of a request: the declared one where there is a query."""
        declared = super().get_route_handler()

        async def handle(request: Request) -> Response:
            if request.scope["query_string"]:
                return await declared(request)
            came = Posted(body=await request.body(), media_type=media_type_of(request))
            camera_id = request.path_params["camera_id"]
            caller = await get_caller(request)
            return await run_in_threadpool(_take, request.state.app, camera_id, came, caller)

        return handle


router = APIRouter(tags=["tracks"], route_class=_PostRoute)


@router.post(
    "/cameras/{camera_id}/tracks",
    status_code=202,
    openapi_extra=_DESCRIBED_BODY,
    response_model=ReceiptOut,
)
def post_tracks(
    camera_id: str,
    came: Annotated[Posted, Depends(posted)],
    state: StateDep,
    caller: CallerDep,
) -> Response:
    """Post tracks of a camera.

    One invalid track does not reject the others. 202 means that the tracks are stored on disk; 422
    means that there were tracks and all of them are invalid.
    """
    return _take(state, camera_id, came, caller)
