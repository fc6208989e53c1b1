"""`POST /cameras/{id}/tracks` in all its forms."""

import time
from typing import Annotated

from fastapi import APIRouter, Depends, Query, Request

from service.cameras import cameras, tracks
from service.errors import UnsupportedMediaTypeError
from service.formats import batch as formats
from service.formats.batch import DEFAULT_SOURCE
from service.formats.mot import read_classes, read_mot
from service.formats.track import Batch, Clock, Limits
from service.http.dependencies import BodyDep, StateDep
from service.schemas.cameras.tracks import DESCRIBED_TRACK, ReceiptOut

router = APIRouter(tags=["tracks"])

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
                        "tracks": {"type": "array", "items": DESCRIBED_TRACK},
                    },
                }
            },
            "application/x-ndjson": {"schema": {"type": "string"}},
            "text/csv": {"schema": {"type": "string"}},
        },
    }
}


def read_batch(
    camera_id: str,
    request: Request,
    body: BodyDep,
    state: StateDep,
    source: Annotated[str, Query(min_length=1, max_length=200)] = DEFAULT_SOURCE,
    frame_rate_hz: Annotated[float | None, Query(gt=0, le=1000)] = None,
    started_at: str | None = None,
    classes: Annotated[str | None, Query(description="of text/csv: who is a person")] = None,
) -> Batch:
    """The tracks of a request, read while no session is open.

    Raises:
        NotFoundError: there is no such camera.
        UnsupportedMediaTypeError: neither JSON, NDJSON nor CSV.
        OverloadedError: other large bodies are being read all the time.
    """
    source = formats.read_source(source, "/source")
    people = None if classes is None else read_classes(classes)
    with state.store.read() as session:
        camera = cameras.require_camera(session, camera_id)
    limits = Limits(
        width=camera.width,
        height=camera.height,
        now_s=time.time(),
        max_ahead_s=state.settings.max_ahead_s,
    )
    clock = Clock(
        frame_rate_hz=frame_rate_hz or camera.frame_rate_hz,
        started_at_s=None if started_at is None else formats.read_time(started_at, "/started_at"),
    )
    media_type = request.headers.get("content-type", "").split(";")[0].strip().lower()
    if len(body) > _LARGE:
        with state.large_bodies.turn(state.settings.http_wait_s):
            return _read(media_type, body, source, clock, limits, people)
    return _read(media_type, body, source, clock, limits, people)


def _read(
    media_type: str,
    body: bytes,
    source: str,
    clock: Clock,
    limits: Limits,
    people: frozenset[int] | None,
) -> Batch:
    if media_type == "application/json":
        return formats.read_json(body, clock, limits)
    if media_type == "application/x-ndjson":
        return formats.read_ndjson(body, source, clock, limits)
    if media_type == "text/csv":
        return read_mot(body, source, clock, limits, people)
    raise UnsupportedMediaTypeError(
        "Content-Type: application/json, application/x-ndjson or text/csv is needed, "
        f"got {media_type or 'none'}"
    )


@router.post(
    "/cameras/{camera_id}/tracks",
    status_code=202,
    openapi_extra=_DESCRIBED_BODY,
    response_model_exclude_defaults=True,
)
def post_tracks(
    camera_id: str, batch: Annotated[Batch, Depends(read_batch)], state: StateDep
) -> ReceiptOut:
    """Store tracks. One bad track never loses the others; 202 means that they are on disk.

    422 where there were tracks and none of them could be taken.
    """
    with state.store.read() as session:
        state.quota.check(session, camera_id, batch)
    with state.store.write() as session:
        cameras.require_camera(session, camera_id)
        receipt = tracks.receive_tracks(
            session, state.queue, camera_id, batch, max_sources=state.settings.max_sources
        )
    return ReceiptOut.from_value(receipt)
