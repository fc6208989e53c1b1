"""Request and response bodies, and their translation to and from values."""

import math
import re
from datetime import UTC, datetime
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, StringConstraints, model_validator

from models.errors import CalibrationError
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose, pose_from_centre, pose_from_matrices
from models.geometry.rotation import nearest_rotation, rotation_from_quaternion
from service.formats.track import Rejection
from service.recalibration.cameras import CameraView
from service.recalibration.operation import Readiness
from service.recalibration.poses import PoseView
from service.recalibration.tracks import Receipt
from service.store.tables import AlertRecord, EstimateRecord, TrainingRecord

CameraId = Annotated[str, StringConstraints(pattern=r"^[a-z0-9][a-z0-9-]{0,62}$")]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Triple = Annotated[list[Finite], Field(min_length=3, max_length=3)]
Who = Annotated[str, StringConstraints(min_length=1, max_length=200)]


class Body(BaseModel):
    """A request body; unknown fields are refused, since they are mostly misspelt ones."""

    model_config = ConfigDict(extra="forbid")


class IntrinsicsBody(Body):
    """Intrinsics in pixels; distortion k1, k2, p1, p2, k3."""

    width: int = Field(gt=0, le=100_000)
    height: int = Field(gt=0, le=100_000)
    fx: Finite = Field(gt=0)
    fy: Finite = Field(gt=0)
    cx: Finite
    cy: Finite
    distortion: list[Finite] = Field(default=[0.0] * 5, min_length=5, max_length=5)

    def to_value(self) -> Intrinsics:
        """The lens as a value."""
        k1, k2, p1, p2, k3 = self.distortion
        fields = self.model_dump(exclude={"distortion"})
        return Intrinsics(**fields, distortion=(k1, k2, p1, p2, k3))

    @classmethod
    def from_value(cls, value: Intrinsics) -> Self:
        """The body of a lens."""
        return cls(
            width=value.width,
            height=value.height,
            fx=value.fx,
            fy=value.fy,
            cx=value.cx,
            cy=value.cy,
            distortion=list(value.distortion),
        )


class PriorPoseBody(Body):
    """A pose in one of four forms: angles, R and t, rvec and tvec, quaternion and position."""

    height_m: Finite | None = None
    tilt_deg: Annotated[Finite, Field(ge=-90, le=90)] | None = None
    roll_deg: Annotated[Finite, Field(ge=-180, le=180)] = 0.0
    heading_deg: Annotated[Finite, Field(ge=-360, le=360)] = 0.0
    x_m: Finite = 0.0
    y_m: Finite = 0.0
    rotation: Annotated[list[Triple], Field(min_length=3, max_length=3)] | None = None
    translation_m: Triple | None = None
    rvec: Triple | None = None
    tvec_m: Triple | None = None
    quaternion_wxyz: Annotated[list[Finite], Field(min_length=4, max_length=4)] | None = None
    position_m: Triple | None = None

    @model_validator(mode="after")
    def _one_form(self) -> Self:
        forms = [
            {"height_m", "tilt_deg", "roll_deg", "heading_deg", "x_m", "y_m"},
            {"rotation", "translation_m"},
            {"rvec", "tvec_m"},
            {"quaternion_wxyz", "position_m"},
        ]
        given = self.model_fields_set
        needed = [{"height_m", "tilt_deg"}, *forms[1:]]
        if not any(need <= given <= form for need, form in zip(needed, forms, strict=True)):
            raise ValueError(
                "one form is needed: height_m and tilt_deg, rotation and translation_m, rvec and "
                f"tvec_m, or quaternion_wxyz and position_m; got {sorted(given)}"
            )
        try:
            self.to_value()
        except CalibrationError as error:
            raise ValueError(str(error)) from error
        return self

    def to_value(self) -> CameraPose:
        """The pose as a value."""
        if self.rotation is not None:
            rotation = nearest_rotation(self.rotation)
            return pose_from_matrices(rotation, np.array(self.translation_m))
        if self.rvec is not None:
            import cv2  # 40 MB that few registrations need

            rotation = np.asarray(cv2.Rodrigues(np.array(self.rvec))[0], dtype=np.float64)
            return pose_from_matrices(rotation, np.array(self.tvec_m))
        if self.quaternion_wxyz is not None:
            rotation = rotation_from_quaternion(self.quaternion_wxyz)
            return pose_from_centre(rotation, np.array(self.position_m))
        assert self.height_m is not None
        assert self.tilt_deg is not None
        return CameraPose(
            height_m=self.height_m,
            tilt_rad=math.radians(self.tilt_deg),
            roll_rad=math.radians(self.roll_deg),
            heading_rad=math.radians(self.heading_deg),
            x_m=self.x_m,
            y_m=self.y_m,
        )


class WalkingSpeedBody(Body):
    """How fast people walk: the default is Carey's (2005)."""

    mean_mps: Finite = Field(1.4, gt=0.1, lt=5)
    sd_mps: Finite = Field(0.1, ge=0, lt=2)


class CameraBody(Body):
    """A camera to register."""

    id: CameraId | None = None
    name: str | None = Field(None, max_length=200)
    intrinsics: IntrinsicsBody
    prior_pose: PriorPoseBody
    frame_rate_hz: Annotated[Finite, Field(gt=0, le=1000)] | None = None
    walking_speed: WalkingSpeedBody = Field(default_factory=WalkingSpeedBody)
    reference_tracks: int = Field(200, ge=5, le=100_000)


class CameraPatch(Body):
    """What to change of a camera; fields left out stay."""

    name: str | None = Field(None, max_length=200)
    intrinsics: IntrinsicsBody | None = None
    prior_pose: PriorPoseBody | None = None
    frame_rate_hz: Annotated[Finite, Field(gt=0, le=1000)] | None = None
    walking_speed: WalkingSpeedBody | None = None
    reference_tracks: int | None = Field(None, ge=5, le=100_000)


class TrainingBody(Body):
    """A training to queue; without a recipe, the service's."""

    recipe: Literal["default", "paper"] | None = None
    seed: int | None = Field(None, ge=0, lt=2**31)


class AcceptBody(Body):
    """Who accepts the served pose as the new prior pose."""

    by: Who | None = None


class AcknowledgeBody(Body):
    """Who has seen the alert."""

    by: Who | None = None


class ResolveBody(Body):
    """How an alert ended."""

    outcome: Literal["put_back", "accepted", "false_alarm"]
    note: str | None = Field(None, max_length=2000)
    by: Who | None = None


class PoseOut(BaseModel):
    """A pose in every form that clients ask for."""

    height_m: float
    tilt_deg: float
    roll_deg: float
    heading_deg: float
    x_m: float
    y_m: float
    quaternion_wxyz: list[float]
    rotation: list[list[float]]
    translation_m: list[float]

    @classmethod
    def from_value(cls, pose: CameraPose) -> Self:
        """The body of a pose."""
        return cls(
            height_m=pose.height_m,
            tilt_deg=math.degrees(pose.tilt_rad),
            roll_deg=math.degrees(pose.roll_rad),
            heading_deg=math.degrees(pose.heading_rad),
            x_m=pose.x_m,
            y_m=pose.y_m,
            quaternion_wxyz=pose.quaternion_wxyz.tolist(),
            rotation=pose.rotation.tolist(),
            translation_m=pose.translation_m.tolist(),
        )


class CameraOut(BaseModel):
    """A registered camera."""

    id: str
    name: str
    intrinsics: IntrinsicsBody
    prior_pose: PoseOut
    frame_rate_hz: float | None
    walking_speed: WalkingSpeedBody
    reference_tracks: int
    tracks: int
    model_id: str | None
    created_at: datetime
    updated_at: datetime

    @classmethod
    def from_value(cls, view: CameraView) -> Self:
        """The body of a camera."""
        record = view.record
        return cls(
            id=record.id,
            name=record.name,
            intrinsics=IntrinsicsBody.from_value(view.intrinsics),
            prior_pose=PoseOut.from_value(view.prior_pose),
            frame_rate_hz=record.frame_rate_hz,
            walking_speed=WalkingSpeedBody(
                mean_mps=record.walking_speed_mean_mps, sd_mps=record.walking_speed_sd_mps
            ),
            reference_tracks=record.reference_tracks,
            tracks=view.tracks,
            model_id=view.model_id,
            created_at=record.created_at,
            updated_at=record.updated_at,
        )


class CameraPage(BaseModel):
    """Some cameras; `next_cursor` leads to more."""

    items: list[CameraOut]
    next_cursor: str | None


class RejectionOut(BaseModel):
    """Why a track was not stored."""

    index: int
    id: str | None
    code: str
    detail: str

    @classmethod
    def from_value(cls, value: Rejection) -> Self:
        """The body of a rejection."""
        return cls(index=value.index, id=value.track_id, code=value.code, detail=value.detail)


class ReceiptOut(BaseModel):
    """What became of the posted tracks."""

    accepted: int
    duplicates: int
    rejected: list[RejectionOut]

    @classmethod
    def from_value(cls, value: Receipt) -> Self:
        """The body of a receipt."""
        return cls(
            accepted=value.accepted,
            duplicates=value.duplicates,
            rejected=[RejectionOut.from_value(item) for item in value.rejections],
        )


class SdOut(BaseModel):
    """Standard deviations of what was estimated."""

    height_m: float
    tilt_deg: float
    roll_deg: float


class DriftOut(BaseModel):
    """Estimate against prior pose."""

    height_m: float
    tilt_deg: float
    roll_deg: float
    angle_deg: float


class ReferenceOut(BaseModel):
    """How much of the reference period has been seen."""

    state: Literal["learning", "ready"]
    tracks: int
    wanted: int
    walking_speed_mps: float | None


class ServedPoseOut(BaseModel):
    """The answer of `GET /cameras/{id}/pose`."""

    model_config = ConfigDict(serialize_by_alias=True)

    camera_id: str
    state: Literal["learning", "ok", "drifting", "no_data", "out_of_range"]
    pose: PoseOut
    estimated: list[str]
    sd: SdOut | None
    drift: DriftOut | None
    estimates: dict[str, Any]
    reference: ReferenceOut
    tracks: int
    from_: datetime | None = Field(serialization_alias="from")
    to: datetime | None
    model_id: str | None
    updated_at: datetime | None
    reason: str

    @classmethod
    def from_value(cls, view: PoseView) -> Self:
        """The body of a served pose."""
        estimate = view.estimate
        return cls(
            camera_id=view.camera_id,
            state=view.state,
            pose=PoseOut.from_value(view.pose),
            estimated=[] if estimate is None else ["height_m", "tilt_deg", "roll_deg"],
            sd=None if estimate is None else sd_out(estimate),
            drift=None if estimate is None else drift_out(estimate),
            estimates={} if estimate is None else estimate.raw,
            reference=ReferenceOut(
                state="learning",
                tracks=min(view.stored_tracks, view.reference_wanted),
                wanted=view.reference_wanted,
                walking_speed_mps=None,
            ),
            tracks=0 if estimate is None else estimate.tracks,
            from_=None if estimate is None else moment(estimate.from_s),
            to=None if estimate is None else moment(estimate.to_s),
            model_id=view.model_id,
            updated_at=None if estimate is None else estimate.created_at,
            reason=view.reason,
        )


class HistoryPoint(BaseModel):
    """One estimate of the history."""

    at: datetime
    state: str
    height_m: float
    tilt_deg: float
    roll_deg: float
    sd: SdOut
    drift: DriftOut
    tracks: int
    to: datetime

    @classmethod
    def from_record(cls, record: EstimateRecord) -> Self:
        """The body of a stored estimate."""
        return cls(
            at=record.created_at,
            state=record.state,
            height_m=record.height_m,
            tilt_deg=math.degrees(record.tilt_rad),
            roll_deg=math.degrees(record.roll_rad),
            sd=sd_out(record),
            drift=drift_out(record),
            tracks=record.tracks,
            to=moment(record.to_s),
        )


class History(BaseModel):
    """Estimates, oldest first."""

    items: list[HistoryPoint]


class ProgressOut(BaseModel):
    """How far a training is."""

    step: int
    steps: int
    loss: float | None
    eta_s: float | None


class TrainingOut(BaseModel):
    """A training."""

    id: str
    camera_id: str
    state: str
    recipe: str
    seed: int
    progress: ProgressOut
    queued_at: datetime
    started_at: datetime | None
    finished_at: datetime | None
    error: str | None
    metrics: dict[str, Any] | None

    @classmethod
    def from_record(cls, record: TrainingRecord) -> Self:
        """The body of a stored training."""
        return cls(
            id=record.id,
            camera_id=record.camera_id,
            state=record.state,
            recipe=record.recipe,
            seed=record.seed,
            progress=ProgressOut(
                step=record.step, steps=record.steps, loss=record.loss, eta_s=record.eta_s
            ),
            queued_at=record.queued_at,
            started_at=record.started_at,
            finished_at=record.finished_at,
            error=record.error,
            metrics=record.metrics,
        )


class TrainingList(BaseModel):
    """Trainings, newest first."""

    items: list[TrainingOut]


class AlertOut(BaseModel):
    """An alert."""

    id: str
    camera_id: str
    kind: str
    state: str
    severity: str
    drift: dict[str, Any]
    opened_at: datetime
    changed_at: datetime | None
    updated_at: datetime
    acknowledged_by: str | None
    acknowledged_at: datetime | None
    silenced_until: datetime | None
    resolved_at: datetime | None
    resolved_by: str | None
    outcome: str | None
    note: str | None

    @classmethod
    def from_record(cls, record: AlertRecord) -> Self:
        """The body of a stored alert."""
        return cls.model_validate(record, from_attributes=True)


class AlertList(BaseModel):
    """Alerts, newest first."""

    items: list[AlertOut]


class HealthOut(BaseModel):
    """The process answers."""

    status: Literal["ok"]


class ReadyOut(BaseModel):
    """Whether the service can do its work."""

    status: Literal["ready", "not_ready"]
    store_writable: bool
    worker_alive: bool
    worker_silent_s: float | None
    queue_lag_s: float
    problems: list[str]

    @classmethod
    def from_value(cls, value: Readiness) -> Self:
        """The body of a readiness check."""
        return cls(
            status="ready" if value.ready else "not_ready",
            store_writable=value.store_writable,
            worker_alive=value.worker_alive,
            worker_silent_s=value.worker_silent_s,
            queue_lag_s=value.queue_lag_s,
            problems=list(value.problems),
        )


def sd_out(record: EstimateRecord) -> SdOut:
    """Standard deviations of a stored estimate."""
    return SdOut(
        height_m=record.height_sd_m,
        tilt_deg=math.degrees(record.tilt_sd_rad),
        roll_deg=math.degrees(record.roll_sd_rad),
    )


def drift_out(record: EstimateRecord) -> DriftOut:
    """Drift of a stored estimate."""
    return DriftOut(
        height_m=record.drift_height_m,
        tilt_deg=math.degrees(record.drift_tilt_rad),
        roll_deg=math.degrees(record.drift_roll_rad),
        angle_deg=math.degrees(record.drift_angle_rad),
    )


def moment(seconds: float) -> datetime:
    """The aware UTC time of seconds since the epoch."""
    return datetime.fromtimestamp(seconds, UTC)


def slug(name: str) -> str:
    """An id made of a name: lower case, digits and hyphens."""
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")[:50]
