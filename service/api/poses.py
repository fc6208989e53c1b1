"""`/cameras/{id}/pose`, `/reference`: the served pose, its history, accepting and resetting."""

from typing import Annotated

from fastapi import APIRouter, Header, Query, Response
from fastapi.responses import PlainTextResponse

from service.api.fields import Moment
from service.api.middleware.dependencies import (
    ActorDep,
    ReadDep,
    StateDep,
    WriteDep,
    name_of,
)
from service.api.poses_schemas import (
    AcceptBody,
    History,
    HistoryPoint,
    PutBackBody,
    ResetBody,
    ServedPoseOut,
)
from service.cameras import cameras, decisions, poses
from service.errors import FieldError, MalformedError
from service.formats.opencv_yaml import opencv_yaml

router = APIRouter(prefix="/cameras/{camera_id}", tags=["pose"])


class _YamlResponse(PlainTextResponse):
    media_type = "application/yaml"


@router.get("/pose", response_model=ServedPoseOut)
def show(
    camera_id: str,
    state: StateDep,
    session: ReadDep,
    response: Response,
    if_none_match: Annotated[str | None, Header()] = None,
) -> ServedPoseOut | Response:
    """The pose now, how sure it is, and why the state is what it is."""
    view = poses.view_pose(session, state.settings, camera_id)
    headers = {"ETag": view.etag}
    if if_none_match is not None and view.etag in map(str.strip, if_none_match.split(",")):
        return Response(status_code=304, headers=headers)
    response.headers.update(headers)
    return ServedPoseOut.from_value(view)


@router.get("/pose.yaml", response_class=_YamlResponse)
def as_yaml(camera_id: str, state: StateDep, session: ReadDep) -> PlainTextResponse:
    """The served pose with its lens as OpenCV's FileStorage reads it, with homographies."""
    view = poses.view_pose(session, state.settings, camera_id)
    lens = cameras.view_camera(session, camera_id).intrinsics
    words = (f"state: {view.state}", f"why: {view.reason}")
    return _YamlResponse(
        opencv_yaml(lens, view.pose, camera_id=camera_id, words=words),
        headers={
            "ETag": view.etag,
            "Content-Disposition": f'inline; filename="{camera_id}.yaml"',
        },
    )


@router.get("/pose/history")
def history(
    camera_id: str,
    session: ReadDep,
    from_: Annotated[Moment | None, Query(alias="from")] = None,
    to: Moment | None = None,
    limit: Annotated[int | None, Query(ge=1, le=10_000)] = None,
    points: Annotated[int | None, Query(ge=2, le=10_000)] = None,
) -> History:
    """The estimates between two times, oldest first: the newest `limit`, 1,000 if unsaid.

    With `points`, at most so many of all of them instead, evenly thinned out: for a chart.
    """
    if points is not None and limit is not None:
        reason = "either limit or points is taken"
        raise MalformedError(f"points: {reason}", (FieldError(pointer="/points", reason=reason),))
    if points is not None:
        records = poses.thinned_history(session, camera_id, from_, to, points)
    else:
        records = poses.pose_history(session, camera_id, from_, to, limit or 1000)
    return History(items=[HistoryPoint.from_record(record) for record in records])


@router.post("/pose/accept")
def accept(
    camera_id: str,
    state: StateDep,
    session: WriteDep,
    actor: ActorDep,
    body: AcceptBody | None = None,
) -> ServedPoseOut:
    """Make the served pose the new prior pose and close its alerts; a new reference begins."""
    said = body or AcceptBody()
    decision = decisions.Decision(camera_id=camera_id, by=name_of(actor, said.by), note=said.note)
    return ServedPoseOut.from_value(
        decisions.accept_pose(session, state.queue, state.settings, decision)
    )


@router.post("/pose/put-back")
def put_back(
    camera_id: str,
    state: StateDep,
    session: WriteDep,
    actor: ActorDep,
    body: PutBackBody | None = None,
) -> ServedPoseOut:
    """Say that the camera is back at its prior pose: closes its alerts; its reference holds."""
    said = body or PutBackBody()
    decision = decisions.Decision(camera_id=camera_id, by=name_of(actor, said.by), note=said.note)
    return ServedPoseOut.from_value(
        decisions.put_back(session, state.queue, state.settings, decision)
    )


@router.post("/reference/reset")
def reset(
    camera_id: str,
    state: StateDep,
    session: WriteDep,
    actor: ActorDep,
    body: ResetBody | None = None,
) -> ServedPoseOut:
    """Say that the camera is at its prior pose and learn anew there; closes its alerts."""
    said = body or ResetBody()
    decision = decisions.Decision(camera_id=camera_id, by=name_of(actor, said.by), note=said.note)
    return ServedPoseOut.from_value(
        decisions.learn_anew(session, state.queue, state.settings, decision)
    )
