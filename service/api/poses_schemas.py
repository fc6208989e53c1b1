"""Bodies of `/cameras/{id}/pose`."""

import math
from datetime import UTC, datetime
from typing import Any, Self

from pydantic import BaseModel, ConfigDict, Field

from models.monitoring.verdict import Drift
from service.api.fields import Body, ReasonCode, ReasonValues, Who
from service.api.geometry_schemas import PoseOut
from service.cameras.poses import PoseView
from service.enums import PoseState, ReferenceState
from service.formats.degrees import in_degrees
from service.reasons import code_of, values_of
from service.store.estimates import EstimateRecord
from service.store.serialization import identifiable_drift, identifiable_sd

_FIELDS = {"height": "height_m", "tilt": "tilt_deg", "roll": "roll_deg", "heading": "heading_deg"}


class AcceptBody(Body):
    """Who accepts the served pose as the new prior pose, and why."""

    by: Who | None = None
    note: str | None = Field(None, max_length=2000)


class PutBackBody(Body):
    """Who says that the camera is back at its prior pose."""

    by: Who | None = None
    note: str | None = Field(None, max_length=2000)


class ResetBody(Body):
    """Who says that the camera is at its prior pose and has to be learned anew there."""

    by: Who | None = None
    note: str | None = Field(None, max_length=2000)


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


class DriftOut(BaseModel):
    """Estimate against prior pose; null where the tracks leave it open.

    `angle_deg` is the whole rotation that the identifiable angles make.
    """

    height_m: float | None
    tilt_deg: float | None
    roll_deg: float | None
    heading_deg: float | None
    angle_deg: float | None

    @classmethod
    def from_value(cls, drift: Drift) -> Self | None:
        """The body of what is identifiable; None where nothing is."""
        return cls(**in_degrees(identifiable_drift(drift))) if drift.identifiable else None


class ReferenceOut(BaseModel):
    """How much of the reference period has been seen."""

    state: ReferenceState
    tracks: int
    wanted: int
    walking_speed_mps: float | None


class ServedPoseOut(BaseModel):
    """The answer of `GET /cameras/{id}/pose`."""

    model_config = ConfigDict(serialize_by_alias=True)

    camera_id: str
    state: PoseState
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
    reason_code: ReasonCode | None
    reason_values: ReasonValues

    @classmethod
    def from_value(cls, view: PoseView) -> Self:
        """The body of a served pose."""
        estimate = view.estimate
        return cls(
            camera_id=view.camera_id,
            state=view.state,
            pose=PoseOut.from_value(view.pose),
            estimated=[field for name, field in _FIELDS.items() if name in view.identifiable],
            sd=None if estimate is None else SdOut.from_value(estimate.drift),
            drift=None if estimate is None else DriftOut.from_value(estimate.drift),
            estimates={} if estimate is None else in_degrees(estimate.raw),
            reference=ReferenceOut(
                state=ReferenceState.READY if view.reference.ready else ReferenceState.LEARNING,
                tracks=view.reference.tracks,
                wanted=view.reference.wanted,
                walking_speed_mps=view.reference.walking_speed_mps,
            ),
            tracks=0 if estimate is None else estimate.tracks,
            from_=None if estimate is None else moment(estimate.from_s),
            to=None if estimate is None else moment(estimate.to_s),
            model_id=view.model_id,
            updated_at=None if estimate is None else estimate.created_at,
            reason=view.reason,
            reason_code=code_of(view.reasons),
            reason_values=values_of(view.reasons),
        )


class HistoryPoint(BaseModel):
    """One estimate of the history."""

    at: datetime
    state: PoseState
    height_m: float
    tilt_deg: float
    roll_deg: float
    heading_deg: float
    sd: SdOut | None
    drift: DriftOut | None
    tracks: int
    to: datetime

    @classmethod
    def from_record(cls, record: EstimateRecord) -> Self:
        """The body of a stored estimate."""
        return cls(
            at=record.created_at,
            state=record.state,
            height_m=record.pose.height_m,
            tilt_deg=math.degrees(record.pose.tilt_rad),
            roll_deg=math.degrees(record.pose.roll_rad),
            heading_deg=math.degrees(record.pose.heading_rad),
            sd=SdOut.from_value(record.drift),
            drift=DriftOut.from_value(record.drift),
            tracks=record.tracks,
            to=moment(record.to_s),
        )


class History(BaseModel):
    """Estimates, oldest first."""

    items: list[HistoryPoint]


def moment(seconds: float) -> datetime:
    """The aware UTC time of seconds since the epoch."""
    return datetime.fromtimestamp(seconds, UTC)
