"""Records of the store. Angles are radians, times aware UTC; track times seconds since epoch."""

from datetime import datetime
from typing import Any

from sqlalchemy import JSON, ForeignKey, Index, LargeBinary, String, UniqueConstraint, text
from sqlalchemy.orm import Mapped, composite, mapped_column

from models.drift.verdict import Drift
from models.geometry.pose_parameters import PoseParameters
from service.kinds import (
    AlertKind,
    AlertSource,
    AlertState,
    Answer,
    EventType,
    Origin,
    Outcome,
    PoseState,
    Severity,
    TrainingState,
)
from service.reason_words import in_words
from service.reasons import Reasons, code_of, values_of
from service.store.record import Record, one_of


def _camera_key() -> Any:
    return mapped_column(ForeignKey("cameras.id", ondelete="CASCADE"))


def _key(target: str, gone: str = "CASCADE", **options: Any) -> Any:
    return mapped_column(ForeignKey(target, ondelete=gone), **options)


def _parameters(*columns: str) -> Any:
    """Four columns as one value; a heading that was never known is 0 and not told."""
    return composite(_as_parameters, *columns)


def _as_parameters(
    height_m: float, tilt_rad: float, roll_rad: float, heading_rad: float | None
) -> PoseParameters:
    return PoseParameters(
        height_m=height_m, tilt_rad=tilt_rad, roll_rad=roll_rad, heading_rad=heading_rad or 0.0
    )


class CameraRecord(Record):
    """A registered camera. `estimate_due_at` is set while tracks wait to be looked at.

    `looked_at_pk` is the newest track that an estimate job has looked at, whatever came of it.
    `estimate_tries` counts the looks since the last one that came to its end. If they fail,
    `estimate_error` says why and `estimate_failing_since` since when. None is begun before
    `estimate_after`. `estimate_lacks` names what failed beside the served estimate.
    """

    __tablename__ = "cameras"

    id: Mapped[str] = mapped_column(String(64), primary_key=True)
    name: Mapped[str]
    width: Mapped[int]
    height: Mapped[int]
    fx: Mapped[float]
    fy: Mapped[float]
    cx: Mapped[float]
    cy: Mapped[float]
    distortion: Mapped[list[float]]
    frame_rate_hz: Mapped[float | None]
    walking_speed_mean_mps: Mapped[float]
    walking_speed_sd_mps: Mapped[float]
    reference_tracks: Mapped[int]
    version: Mapped[int]
    estimate_due_at: Mapped[datetime | None]
    looked_at_pk: Mapped[int | None]
    estimate_tries: Mapped[int] = mapped_column(default=0)
    estimate_error: Mapped[str | None]
    estimate_failing_since: Mapped[datetime | None]
    estimate_after: Mapped[datetime | None]
    estimate_lacks: Mapped[str | None]
    created_at: Mapped[datetime]
    updated_at: Mapped[datetime]


class PriorPoseRecord(Record):
    """A pose that was trusted from a time on; the newest of a camera is its prior pose."""

    __tablename__ = "prior_poses"

    id: Mapped[int] = mapped_column(primary_key=True)
    camera_id: Mapped[str] = _camera_key()
    height_m: Mapped[float]
    tilt_rad: Mapped[float]
    roll_rad: Mapped[float]
    heading_rad: Mapped[float]
    x_m: Mapped[float]
    y_m: Mapped[float]
    origin: Mapped[Origin]
    trusted_by: Mapped[str | None]
    created_at: Mapped[datetime]

    __table_args__ = (
        one_of("origin", (Origin.REGISTERED, Origin.CHANGED, Origin.ACCEPTED)),
        Index(None, "camera_id", "id"),
    )


class SiteReferenceRecord(Record):
    """What estimators say while a camera is known to be at its prior pose; the newest counts.

    It is learned once, of `wanted` tracks that started at `from_s` or later; until then `ready_at`
    is unset. It is of the tracks of one `source`, which counts: the first to post, where none is
    said. `to_s` is when the last of them ended, `data` the site (`models.estimation.joint`).
    Later, `window_from_s` is when the first track after the newest change of the camera ended, and
    `changed_s` when it started. `answer` is what a person said last of how the camera stands:
    estimates of before `answered_at` say nothing of it any more.
    """

    __tablename__ = "site_references"

    id: Mapped[int] = mapped_column(primary_key=True)
    camera_id: Mapped[str] = _camera_key()
    prior_pose_id: Mapped[int] = _key("prior_poses.id", index=True)
    origin: Mapped[Origin]
    source: Mapped[str | None]
    requested_by: Mapped[str | None]
    from_s: Mapped[float | None]
    to_s: Mapped[float | None]
    wanted: Mapped[int]
    tracks: Mapped[int]
    data: Mapped[bytes | None] = mapped_column(LargeBinary)
    walking_speed_mps: Mapped[float | None]
    doubts: Mapped[Reasons]
    window_from_s: Mapped[float | None]
    changed_s: Mapped[float | None]
    answer: Mapped[Answer | None]
    answered_by: Mapped[str | None]
    answered_at: Mapped[datetime | None]
    created_at: Mapped[datetime]
    ready_at: Mapped[datetime | None]

    __table_args__ = (
        one_of("origin", Origin),
        one_of("answer", (Answer.PUT_BACK, Answer.FALSE_ALARM)),
        Index(None, "camera_id", "id"),
    )


class FlowMapRecord(Record):
    """Where people walk at a reference's site (`models.flow`), learned of `tracks` tracks.

    `data` is None where too few of them walk. `chart` is the drift chart (`models.drift`) that goes
    with it. `to_s` is when the last of them ended, `weight` what they count for together, of whom
    older ones count less.
    """

    __tablename__ = "flow_maps"

    reference_id: Mapped[int] = _key("site_references.id", primary_key=True)
    data: Mapped[bytes | None] = mapped_column(LargeBinary)
    chart: Mapped[bytes | None] = mapped_column(LargeBinary)
    tracks: Mapped[int]
    weight: Mapped[float]
    to_s: Mapped[float]
    learned_at: Mapped[datetime]


class TrackRecord(Record):
    """A stored track: points (N, 3) and boxes (N, 4) packed as little-endian float64."""

    __tablename__ = "tracks"

    id: Mapped[int] = mapped_column(primary_key=True)
    camera_id: Mapped[str] = _camera_key()
    source: Mapped[str]
    track_id: Mapped[str]
    started_s: Mapped[float]
    ended_s: Mapped[float]
    points: Mapped[bytes] = mapped_column(LargeBinary)
    boxes: Mapped[bytes | None] = mapped_column(LargeBinary)
    received_at: Mapped[datetime]

    __table_args__ = (
        UniqueConstraint("camera_id", "source", "track_id", "started_s"),
        Index(None, "camera_id", "ended_s", "source"),
        Index(None, "camera_id", "id"),
        # What counts is counted without its points; when it came is the camera's rhythm.
        Index(None, "camera_id", "received_at", "ended_s", "source"),
    )


class TrainingRecord(Record):
    """One training run; `attempt` grows each time a worker takes it up.

    `around` has the height, tilt and roll that it is centred on, where these are not the prior's.
    """

    __tablename__ = "trainings"

    id: Mapped[str] = mapped_column(String(32), primary_key=True)
    camera_id: Mapped[str] = _camera_key()
    prior_pose_id: Mapped[int] = _key("prior_poses.id", index=True)
    recipe: Mapped[str]
    around: Mapped[dict[str, Any] | None]
    seed: Mapped[int]
    state: Mapped[TrainingState]
    attempt: Mapped[int]
    cancel_requested: Mapped[bool]
    step: Mapped[int]
    steps: Mapped[int]
    loss: Mapped[float | None]
    eta_s: Mapped[float | None]
    error: Mapped[str | None]
    metrics: Mapped[dict[str, Any] | None]
    queued_at: Mapped[datetime]
    started_at: Mapped[datetime | None]
    finished_at: Mapped[datetime | None]

    __table_args__ = (
        one_of("state", TrainingState),
        Index(None, "camera_id", "queued_at"),
        Index(None, "state"),
    )


class ModelRecord(Record):
    """A published model; its weights are the file `<weights_sha256>.safetensors`."""

    __tablename__ = "models"

    id: Mapped[str] = mapped_column(String(32), primary_key=True)
    camera_id: Mapped[str] = _camera_key()
    prior_pose_id: Mapped[int] = _key("prior_poses.id", index=True)
    training_id: Mapped[str] = _key("trainings.id", unique=True)
    weights_sha256: Mapped[str] = mapped_column(String(64))
    config: Mapped[dict[str, Any]]
    seed: Mapped[int]
    step_s: Mapped[float]
    metrics: Mapped[dict[str, Any]]
    created_at: Mapped[datetime]

    __table_args__ = (Index(None, "camera_id", "created_at"),)


class PredictionRecord(Record):
    """What a model says of a track; without numbers where the track gives no window."""

    __tablename__ = "predictions"

    model_id: Mapped[str] = _key("models.id", primary_key=True)
    track_pk: Mapped[int] = mapped_column(
        ForeignKey("tracks.id", ondelete="CASCADE"), primary_key=True, index=True
    )
    windows: Mapped[int]
    height_m: Mapped[float | None]
    qw: Mapped[float | None]
    qx: Mapped[float | None]
    qy: Mapped[float | None]
    qz: Mapped[float | None]


class EstimateRecord(Record):
    """The served pose at one time, and what is behind it.

    `pose` is the served one: the prior's where the tracks cannot tell. `drift_by` and `pose_sd` are
    the estimator's for all four parameters; `told` names those that count.
    `raw` has each estimator's own answer. `model_id` is of the averaged estimate beside the served
    one. Estimates of before there were flow maps have no `heading_sd_rad`.
    """

    __tablename__ = "estimates"

    id: Mapped[int] = mapped_column(primary_key=True)
    camera_id: Mapped[str] = _camera_key()
    model_id: Mapped[str | None] = _key("models.id", "SET NULL", index=True)
    prior_pose_id: Mapped[int] = _key("prior_poses.id", index=True)
    reference_id: Mapped[int | None] = _key("site_references.id", index=True)
    state: Mapped[PoseState]
    reasons: Mapped[Reasons]
    told: Mapped[list[str]]  # of tilt, roll, height, heading
    height_m: Mapped[float]
    tilt_rad: Mapped[float]
    roll_rad: Mapped[float]
    heading_rad: Mapped[float]
    height_sd_m: Mapped[float]
    tilt_sd_rad: Mapped[float]
    roll_sd_rad: Mapped[float]
    heading_sd_rad: Mapped[float | None]
    drift_height_m: Mapped[float]
    drift_tilt_rad: Mapped[float]
    drift_roll_rad: Mapped[float]
    drift_heading_rad: Mapped[float]
    drift_angle_rad: Mapped[float]
    suspected: Mapped[bool]  # the score test says that the camera has moved
    drift_streak: Mapped[int]  # 1: beyond the limits; -1: below the share that clears
    drifted: Mapped[list[str]]  # of those: what has been beyond since it began
    drift_since: Mapped[datetime | None]
    raw: Mapped[dict[str, Any]]
    tracks: Mapped[int]
    from_s: Mapped[float]
    to_s: Mapped[float]
    newest_track_pk: Mapped[int]
    created_at: Mapped[datetime]
    pose: Mapped[PoseParameters] = _parameters("height_m", "tilt_rad", "roll_rad", "heading_rad")
    pose_sd: Mapped[PoseParameters] = _parameters(
        "height_sd_m", "tilt_sd_rad", "roll_sd_rad", "heading_sd_rad"
    )
    drift_by: Mapped[PoseParameters] = _parameters(
        "drift_height_m", "drift_tilt_rad", "drift_roll_rad", "drift_heading_rad"
    )

    __table_args__ = (
        # That nobody comes is no estimate's to say.
        one_of("state", [state for state in PoseState if state != PoseState.NO_DATA]),
        Index(None, "camera_id", "id"),
    )

    @property
    def drift(self) -> Drift:
        """The drift against the prior pose, and which of it is told."""
        return Drift(
            by=self.drift_by,
            sd=self.pose_sd,
            angle_rad=self.drift_angle_rad,
            told=tuple(self.told),
        )


_FIRING = f"state = '{AlertState.FIRING}'"


class AlertRecord(Record):
    """An alert; at most one of a camera and kind is firing.

    `source` tells whether an estimate fired it, which then ends it too, the reference, the camera's
    rhythm, the upkeep, or a group. A group's alert has no camera but `camera_ids`, and its members
    have its id as `group_id`; at most one of a `track_source` and kind is firing. `told` says
    whether an event told of the alert by itself.
    """

    __tablename__ = "alerts"

    id: Mapped[str] = mapped_column(String(32), primary_key=True)
    camera_id: Mapped[str | None] = _camera_key()
    camera_ids: Mapped[list[str] | None] = mapped_column(JSON(none_as_null=True))
    group_id: Mapped[str | None] = _key("alerts.id", "SET NULL", index=True)
    track_source: Mapped[str | None]
    kind: Mapped[AlertKind]
    state: Mapped[AlertState]
    source: Mapped[AlertSource]
    told: Mapped[bool] = mapped_column(default=False)
    severity: Mapped[Severity]
    reasons: Mapped[Reasons]
    drift: Mapped[dict[str, Any]]
    opened_at: Mapped[datetime]
    changed_at: Mapped[datetime | None]
    updated_at: Mapped[datetime]
    acknowledged_by: Mapped[str | None]
    acknowledged_at: Mapped[datetime | None]
    silenced_until: Mapped[datetime | None]
    silence_reason: Mapped[str | None]
    silenced_by: Mapped[str | None]
    resolved_at: Mapped[datetime | None]
    resolved_by: Mapped[str | None]
    outcome: Mapped[Outcome | None]
    note: Mapped[str | None]

    __table_args__ = (
        one_of("kind", AlertKind),
        one_of("state", AlertState),
        one_of("source", AlertSource),
        one_of("severity", Severity),
        one_of("outcome", Outcome),
        Index(
            "uq_alerts_firing",
            "camera_id",
            "kind",
            unique=True,
            sqlite_where=text(_FIRING),
            postgresql_where=text(_FIRING),
        ),
        Index(
            "uq_alerts_firing_group",
            "track_source",
            "kind",
            unique=True,
            sqlite_where=text(f"{_FIRING} AND camera_id IS NULL"),
            postgresql_where=text(f"{_FIRING} AND camera_id IS NULL"),
        ),
        Index(None, "opened_at"),
        Index(None, "camera_id", "opened_at"),
    )

    @property
    def reason(self) -> str:
        """Why it was opened, in words."""
        return in_words(self.reasons)

    @property
    def reason_code(self) -> str | None:
        """The code of the first reason; None of a group that is about to be told."""
        return code_of(self.reasons)

    @property
    def reason_values(self) -> dict[str, Any]:
        """The numbers and names of the first reason, angles in degrees."""
        return values_of(self.reasons)


class EventRecord(Record):
    """Something that happened, for `GET /events`."""

    __tablename__ = "events"

    id: Mapped[int] = mapped_column(primary_key=True)
    type: Mapped[EventType]
    payload: Mapped[dict[str, Any]]
    created_at: Mapped[datetime]

    __table_args__ = (
        one_of("type", EventType),
        {"sqlite_autoincrement": True},  # an id is never given twice
    )
