"""`/cameras/{id}/pose`, `/reference`: the served pose, its history, accepting and resetting."""

from collections.abc import Callable
from dataclasses import asdict
from datetime import datetime
from typing import Annotated, Any, Self

from fastapi import APIRouter, Header, Query, Response
from fastapi.responses import PlainTextResponse
from pydantic import BaseModel, ConfigDict, Field
from sqlalchemy.orm import Session

from models.monitoring.drift import Drift
from service.api.ignored import NamingRoute
from service.api.middleware.dependencies import (
    AppState,
    ReadDep,
    StateDep,
    WriteDep,
)
from service.api.middleware.pages import REVALIDATED
from service.api.schemas import (
    POSE_FIELDS,
    AlternativeOut,
    Body,
    Moment,
    Out,
    PoseOut,
    QuestionOut,
    ReasonCode,
    ReasonValues,
    ReferenceOut,
    SinceOut,
    Who,
)
from service.cameras import cameras, decisions, poses
from service.cameras.answers import Decision
from service.cameras.poses import PoseView
from service.cameras.proposals import Proposal
from service.cameras.undo import undo_answer
from service.degrees import in_degrees
from service.enums import PoseState
from service.errors import ConflictError, MalformedError
from service.formats.geojson import GeoOrigin
from service.formats.pose_formats import MEDIA_TYPES, PoseFormat, pose_file
from service.job_queue import JobQueue
from service.reasons import code_of, values_of
from service.settings import Settings
from service.store.access import name_in
from service.store.estimates import EstimateRecord, identifiable_drift, identifiable_sd
from service.wording.image_sizes import question_words
from service.wording.times import from_seconds


class _DecisionBody(Body):
    by: Who | None = None
    note: str | None = Field(None, max_length=2000)


class AcceptBody(_DecisionBody):
    """Who accepts the served pose as the new prior pose, and why."""


class ConfirmBody(_DecisionBody):
    """Who agrees to the pose that people told of a camera without a prior pose."""


class PutBackBody(_DecisionBody):
    """Who says that the camera is back at its prior pose."""


class ResetBody(_DecisionBody):
    """Who says that the camera is at its prior pose and has to be learned anew there."""


class UndoBody(_DecisionBody):
    """Who takes the last answer about the pose back, and why."""


class SdOut(BaseModel):
    """Standard deviations of what was estimated; null where the tracks cannot tell."""

    height_m: float | None
    tilt_deg: float | None
    roll_deg: float | None
    heading_deg: float | None

    @classmethod
    def from_value(cls, drift: Drift) -> Self | None:
        """The body of what is identifiable; None where nothing is."""
        return cls(**in_degrees(identifiable_sd(drift))) if drift.identifiable else None


class DriftOut(SdOut):
    """Estimate against prior pose; null where the tracks leave it open.

    `angle_deg` is the whole rotation that the identifiable angles make.
    """

    angle_deg: float | None

    @classmethod
    def from_value(cls, drift: Drift) -> Self | None:
        """The body of what is identifiable; None where nothing is."""
        return cls(**in_degrees(identifiable_drift(drift))) if drift.identifiable else None


class ProposedOut(BaseModel):
    """The pose that people and hints tell of a camera without a prior pose, with its deviations.

    It can be agreed to where they tell enough. Unless two points of a map tell where it stands, it
    is over the world's origin and heads along its Y.
    """

    pose: PoseOut
    sd: SdOut
    tracks: int
    can_be_confirmed: bool
    updated_at: datetime

    @classmethod
    def from_value(cls, proposal: Proposal) -> Self:
        """The body of a proposed pose."""
        sd = {"heading_deg": None} | in_degrees(proposal.sd)
        return cls(
            pose=PoseOut.from_value(proposal.pose),
            sd=SdOut(**sd),
            tracks=proposal.tracks,
            can_be_confirmed=proposal.told,
            updated_at=proposal.updated_at,
        )


class ServedPoseOut(BaseModel):
    """The answer of `GET /cameras/{id}/pose`."""

    model_config = ConfigDict(serialize_by_alias=True)

    camera_id: str
    state: PoseState
    pose: PoseOut
    proposed: ProposedOut | None
    estimated: list[str]
    sd: SdOut | None
    drift: DriftOut | None
    moved: float | None
    moved_parameters: dict[str, float | None]
    alternatives: list[AlternativeOut]
    detectable: dict[str, dict[int, float] | None]
    since: SinceOut
    estimates: dict[str, Any]
    reference: ReferenceOut
    tracks: int
    from_: datetime | None = Field(serialization_alias="from")
    to: datetime | None
    model_id: str | None
    updated_at: datetime | None = Field(description="time of the last full estimate")
    checked_at: datetime | None = Field(
        description="time at which the newest stored tracks had been monitored"
    )
    reason: str
    reason_code: ReasonCode | None
    reason_values: ReasonValues
    questions: list[QuestionOut] = Field(
        description="about the input; nothing is learned from tracks in question until an answer"
    )

    @classmethod
    def from_value(cls, view: PoseView) -> Self:
        """The body of a served pose."""
        status, estimate = view.status, view.status.estimate
        return cls(
            camera_id=status.camera_id,
            state=status.state,
            pose=PoseOut.from_value(view.pose),
            proposed=None if view.proposed is None else ProposedOut.from_value(view.proposed),
            estimated=[field for name, field in POSE_FIELDS.items() if name in status.identifiable],
            sd=None if estimate is None else SdOut.from_value(estimate.drift),
            drift=None if estimate is None else DriftOut.from_value(estimate.drift),
            moved=None if estimate is None else estimate.moved,
            moved_parameters=_moved_parameters(estimate),
            alternatives=[]
            if estimate is None
            else in_degrees({"alternatives": estimate.alternatives})["alternatives"],
            detectable=_detectable(estimate),
            since=SinceOut(
                after=None if estimate is None else estimate.drift_after,
                before=None if estimate is None else estimate.drift_since,
            ),
            estimates=in_degrees(view.estimates),
            reference=ReferenceOut.of(view.reference),
            tracks=0 if estimate is None else estimate.tracks,
            from_=None if estimate is None else from_seconds(estimate.from_s),
            to=None if estimate is None else from_seconds(estimate.to_s),
            model_id=view.model_id,
            updated_at=None if estimate is None else estimate.created_at,
            checked_at=view.checked_at,
            reason=view.reason,
            reason_code=code_of(view.reasons),
            reason_values=values_of(view.reasons),
            questions=_questions(view),
        )


class HistoryPoint(Out):
    """One estimate of the history."""

    at: datetime
    state: PoseState
    height_m: float
    tilt_deg: float
    roll_deg: float
    heading_deg: float
    sd: SdOut | None
    drift: DriftOut | None
    moved: float
    tracks: int
    to: datetime

    @classmethod
    def from_record(cls, record: EstimateRecord) -> Self:
        """The body of a stored estimate."""
        return cls.of(
            record,
            at=record.created_at,
            **in_degrees(asdict(record.pose)),
            sd=SdOut.from_value(record.drift),
            drift=DriftOut.from_value(record.drift),
            to=from_seconds(record.to_s),
        )


class History(BaseModel):
    """Estimates, oldest first."""

    items: list[HistoryPoint]


def _questions(view: PoseView) -> list[QuestionOut]:
    asked = view.question
    if asked is None:
        return []
    return [
        QuestionOut(
            field=next(iter(asked.fixes[0])),
            text=question_words(asked.reason),
            fixes=list(asked.fixes),
            keep=asked.keep,
        )
    ]


def _moved_parameters(estimate: EstimateRecord | None) -> dict[str, float | None]:
    """The probability that each number of a pose changed; None where nothing is known."""
    shares = {} if estimate is None else estimate.moved_parameters
    return {field: shares.get(name) for name, field in POSE_FIELDS.items()}


def _detectable(estimate: EstimateRecord | None) -> dict[str, dict[int, float] | None]:
    """The smallest move of each number that so many people would tell; None where none is."""
    known = {} if estimate is None else in_degrees(estimate.detectable)
    return {
        field: None
        if known.get(field) is None
        else dict(zip(known["people"], known[field], strict=True))
        for field in POSE_FIELDS.values()
    }


router = APIRouter(prefix="/cameras/{camera_id}", tags=["pose"], route_class=NamingRoute)


class _YamlResponse(PlainTextResponse):
    media_type = MEDIA_TYPES[PoseFormat.OPENCV]


_Format = Annotated[
    PoseFormat | None,
    Query(alias="format", description="a file for another tool, with the lens; else our JSON"),
]
_Latitude = Annotated[
    float | None,
    Query(ge=-85, le=85, description="with geojson: of the world's x = y = 0, whose +Y is north"),
]
_Longitude = Annotated[
    float | None, Query(ge=-180, le=180, description="with geojson, beside the latitude")
]
_FILES: dict[str, Any] = {kind: {} for kind in sorted(set(MEDIA_TYPES.values()))}


@router.get("/pose", response_model=ServedPoseOut, responses={200: {"content": _FILES}})
def get_pose(
    camera_id: str,
    state: StateDep,
    session: ReadDep,
    response: Response,
    format_: _Format = None,
    origin_lat_deg: _Latitude = None,
    origin_lon_deg: _Longitude = None,
    if_none_match: Annotated[str | None, Header()] = None,
) -> ServedPoseOut | Response:
    """Get the pose of a camera.

    The answer has its uncertainty and the reason for the state. With `format`, it is a file for
    another tool; the guide to formats lists what each file holds.
    """
    view = poses.view_pose(session, state.settings, camera_id)
    headers = {"ETag": view.etag, **REVALIDATED}
    if if_none_match is not None and view.etag in map(str.strip, if_none_match.split(",")):
        return Response(status_code=304, headers=headers)
    if format_ is not None:
        return _file(session, view, format_, _origin(origin_lat_deg, origin_lon_deg))
    response.headers.update(headers)
    return ServedPoseOut.from_value(view)


@router.get("/pose.yaml", response_class=_YamlResponse)
def get_pose_as_opencv_yaml(camera_id: str, state: StateDep, session: ReadDep) -> Response:
    """Get the pose as an OpenCV YAML file.

    The file has the lens and the homographies between ground and image.
    """
    view = poses.view_pose(session, state.settings, camera_id)
    return _file(session, view, PoseFormat.OPENCV, None)


def _file(session: Session, view: PoseView, kind: PoseFormat, origin: GeoOrigin | None) -> Response:
    camera_id, estimate = view.status.camera_id, view.status.estimate
    if not view.calibrated:
        raise ConflictError("pose: no prior pose has been confirmed yet")
    file = pose_file(
        kind,
        cameras.require_camera(session, camera_id).intrinsics,
        view.pose,
        camera_id=camera_id,
        at=None if estimate is None else from_seconds(estimate.to_s),
        words=(f"state: {view.status.state}", f"why: {view.reason}"),
        origin=origin,
    )
    headers = {"ETag": view.etag, "Content-Disposition": f'inline; filename="{file.name}"'}
    return Response(file.content, media_type=file.media_type, headers=headers)


def _origin(lat_deg: float | None, lon_deg: float | None) -> GeoOrigin | None:
    if lat_deg is None and lon_deg is None:
        return None
    for name, value in (("origin_lat_deg", lat_deg), ("origin_lon_deg", lon_deg)):
        if value is None:
            raise MalformedError.of_field(name, "latitude and longitude are needed together")
    assert lat_deg is not None
    assert lon_deg is not None
    return GeoOrigin(lat_deg=lat_deg, lon_deg=lon_deg)


@router.get("/pose/history")
def list_pose_history(
    camera_id: str,
    session: ReadDep,
    from_: Annotated[Moment | None, Query(alias="from")] = None,
    to: Moment | None = None,
    limit: Annotated[int | None, Query(ge=1, le=10_000)] = None,
    points: Annotated[int | None, Query(ge=2, le=10_000)] = None,
) -> History:
    """List the estimates of a camera between two times.

    They are ordered by time: the newest `limit` of them, 1,000 by default. With `points`, all
    estimates are thinned out evenly to at most that number, for a chart.
    """
    if points is not None and limit is not None:
        raise MalformedError.of_field("points", "either limit or points is taken")
    records = poses.pose_history(
        session, camera_id, from_, to, newest=limit or 1000, thinned=points
    )
    return History(items=[HistoryPoint.from_record(record) for record in records])


@router.post("/pose/confirm")
def confirm_pose(
    camera_id: str, state: StateDep, session: WriteDep, body: ConfirmBody | None = None
) -> ServedPoseOut:
    """Confirm the proposed pose.

    It becomes the prior pose, with its uncertainty.
    """
    return _decide(decisions.confirm_pose, state, session, camera_id, body)


@router.post("/pose/accept")
def accept_pose(
    camera_id: str, state: StateDep, session: WriteDep, body: AcceptBody | None = None
) -> ServedPoseOut:
    """Accept the served pose as the new prior pose.

    The alerts about the pose are closed, and a new reference begins.
    """
    return _decide(decisions.accept_pose, state, session, camera_id, body)


@router.post("/pose/put-back")
def put_pose_back(
    camera_id: str, state: StateDep, session: WriteDep, body: PutBackBody | None = None
) -> ServedPoseOut:
    """Report that a camera is back at its prior pose.

    The alerts about the pose are closed. The learned reference is kept.
    """
    return _decide(decisions.put_back, state, session, camera_id, body)


@router.post("/pose/undo")
def undo_answer_about_pose(
    camera_id: str, state: StateDep, session: WriteDep, body: UndoBody | None = None
) -> ServedPoseOut:
    """Undo the last answer about the pose.

    This is possible for 15 minutes, unless a later change depends on the answer.
    """
    return _decide(undo_answer, state, session, camera_id, body)


@router.post("/reference/reset")
def reset_reference(
    camera_id: str, state: StateDep, session: WriteDep, body: ResetBody | None = None
) -> ServedPoseOut:
    """Start a new reference at the prior pose.

    The camera has to be at its prior pose. The alerts about the pose are closed.
    """
    return _decide(decisions.learn_anew, state, session, camera_id, body)


def _decide(
    use_case: Callable[[Session, JobQueue, Settings, Decision], PoseView],
    state: AppState,
    session: Session,
    camera_id: str,
    body: _DecisionBody | None,
) -> ServedPoseOut:
    said = body or _DecisionBody()
    decision = Decision(camera_id=camera_id, by=name_in(session, said.by), note=said.note)
    return ServedPoseOut.from_value(use_case(session, state.queue, state.settings, decision))
