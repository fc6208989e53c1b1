"""`/cameras`: register, list, show, change, remove."""

from typing import Annotated

from fastapi import APIRouter, Query, Response

from service.api.middleware.dependencies import EtagDep, ReadDep, StateDep, WriteDep
from service.api.schemas.base import Text
from service.api.schemas.cameras.cameras import CameraBody, CameraOut, CameraPage, CameraPatch
from service.cameras import cameras
from service.cameras.cameras import CameraChange

router = APIRouter(prefix="/cameras", tags=["cameras"])


@router.post("", status_code=201)
def register(body: CameraBody, state: StateDep, session: WriteDep, response: Response) -> CameraOut:
    """Register a camera with its intrinsics and prior pose; queues its first training."""
    view = cameras.register_camera(session, state.queue, state.settings, body.to_spec())
    response.headers["Location"] = f"/cameras/{view.record.id}"
    response.headers["ETag"] = view.etag
    return CameraOut.from_value(view)


@router.get("")
def list_all(
    session: ReadDep, cursor: Text = "", limit: Annotated[int, Query(ge=1, le=1000)] = 100
) -> CameraPage:
    """Cameras in order of their ids; `next_cursor` leads to the next page."""
    views = cameras.list_cameras(session, cursor, limit + 1)
    page = views[:limit]
    return CameraPage(
        items=[CameraOut.from_value(view) for view in page],
        next_cursor=page[-1].record.id if len(views) > limit else None,
    )


@router.get("/{camera_id}")
def show(camera_id: str, session: ReadDep, response: Response) -> CameraOut:
    """A camera, with the ETag that a change asks for."""
    view = cameras.view_camera(session, camera_id)
    response.headers["ETag"] = view.etag
    return CameraOut.from_value(view)


@router.patch("/{camera_id}")
def change(
    camera_id: str,
    body: CameraPatch,
    etag: EtagDep,
    state: StateDep,
    session: WriteDep,
    response: Response,
) -> CameraOut:
    """Change a camera; another lens, prior pose or walking speed queues a training."""
    speed = body.walking_speed
    view = cameras.change_camera(
        session,
        state.queue,
        state.settings,
        camera_id,
        etag,
        CameraChange(
            name=body.name,
            intrinsics=None if body.intrinsics is None else body.intrinsics.to_value(),
            prior_pose=None if body.prior_pose is None else body.prior_pose.to_value(),
            frame_rate_hz=body.frame_rate_hz,
            walking_speed_mean_mps=None if speed is None else speed.mean_mps,
            walking_speed_sd_mps=None if speed is None else speed.sd_mps,
            reference_tracks=body.reference_tracks,
        ),
    )
    response.headers["ETag"] = view.etag
    return CameraOut.from_value(view)


@router.delete("/{camera_id}", status_code=204)
def remove(camera_id: str, etag: EtagDep, session: WriteDep) -> None:
    """Delete a camera with its tracks, models, estimates and alerts."""
    cameras.remove_camera(session, camera_id, etag)
