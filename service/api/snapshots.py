"""`/cameras/{id}/snapshot`: still images, off unless switched on: the newest, and one of before."""

import hashlib
from datetime import datetime
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Header, Query, Request, Response

from service.api.middleware.dependencies import (
    BodyDep,
    ReadDep,
    StateDep,
    WriteDep,
    WritesDep,
    media_type_of,
)
from service.api.middleware.pages import REVALIDATED
from service.api.schemas import Moment, Out
from service.cameras import cameras, snapshots
from service.formats.still import Still, read_still


class SnapshotOut(Out):
    """What is known of a still image."""

    sha256: str
    width: int
    height: int
    taken_at: datetime
    stored_at: datetime


router = APIRouter(prefix="/cameras/{camera_id}/snapshot", tags=["cameras"])

_IMAGE = {"schema": {"type": "string", "format": "binary"}}
IMAGE_BODY: dict[str, Any] = {
    "requestBody": {"required": True, "content": {"image/jpeg": _IMAGE, "image/png": _IMAGE}}
}
IMAGE_ANSWER: dict[int | str, dict[str, Any]] = {200: {"content": {"image/jpeg": _IMAGE}}}


def read_body(camera_id: str, request: Request, body: BodyDep, state: StateDep) -> Still:
    """The still image of a request, decoded while no session is open."""
    with state.store.read() as session:
        cameras.require_camera(session, camera_id)
    snapshots.require_snapshots(state.settings)
    with state.stills.turn(state.settings.http_wait_s):
        return read_still(body, media_type_of(request))


@router.put("", openapi_extra=IMAGE_BODY)
def put_snapshot(
    camera_id: str,
    still: Annotated[Still, Depends(read_body)],
    state: StateDep,
    write: WritesDep,
    taken_at: Annotated[Moment | None, Query(description="now, if not given")] = None,
) -> SnapshotOut:
    """Store an image of a camera.

    The image is compared with earlier ones, and stored if the settings allow it: without EXIF, at
    most 1920 px wide.
    """
    with write(camera_id) as session:
        facts = snapshots.put_snapshot(session, state.queue, camera_id, still, taken_at)
    return SnapshotOut.model_validate(facts)


@router.get("", response_class=Response, responses=IMAGE_ANSWER)
def get_snapshot(
    camera_id: str,
    state: StateDep,
    session: ReadDep,
    if_none_match: Annotated[str | None, Header()] = None,
    stood: Annotated[
        bool, Query(description="the newest by which it stood at its prior pose")
    ] = False,
) -> Response:
    """Get the image of a camera.

    It is the newest one, or the newest one from before a move.
    """
    if stood:
        jpeg = snapshots.show_stood(session, state.settings, camera_id)
    else:
        jpeg = snapshots.show_snapshot(session, state.settings, camera_id).jpeg
    return jpeg_answer(jpeg, if_none_match)


def jpeg_answer(jpeg: bytes, if_none_match: str | None) -> Response:
    """The answer with an image that only the caller's browser keeps; 304 if it has it."""
    digest = hashlib.sha256(jpeg).hexdigest()
    headers = {"ETag": f'"{digest}"', **REVALIDATED}
    if if_none_match == headers["ETag"]:
        return Response(status_code=304, headers=headers)
    return Response(jpeg, media_type="image/jpeg", headers=headers)


@router.delete("", status_code=204)
def delete_snapshot(camera_id: str, session: WriteDep) -> None:
    """Delete the image of a camera."""
    snapshots.remove_snapshot(session, camera_id)
