"""Bodies of `/cameras`."""

import re
from datetime import datetime
from typing import Annotated, Self

from pydantic import BaseModel, Field, StringConstraints

from service.api.schemas.base import Body, CameraId, Finite
from service.api.schemas.cameras.geometry import IntrinsicsBody, PoseOut, PriorPoseBody
from service.cameras.cameras import CameraSpec, CameraView

CameraName = Annotated[str, StringConstraints(max_length=200)]
FrameRate = Annotated[Finite, Field(gt=0, le=1000)]
ReferenceTracks = Annotated[int, Field(ge=5, le=100_000)]


class WalkingSpeedBody(Body):
    """How fast people walk: the default is Carey's (2005)."""

    mean_mps: Finite = Field(1.4, gt=0.1, lt=5)
    sd_mps: Finite = Field(0.1, ge=0, lt=2)


class CameraBody(Body):
    """A camera to register."""

    id: CameraId | None = None
    name: CameraName | None = None
    intrinsics: IntrinsicsBody
    prior_pose: PriorPoseBody
    frame_rate_hz: FrameRate | None = None
    walking_speed: WalkingSpeedBody = Field(default_factory=WalkingSpeedBody)
    reference_tracks: ReferenceTracks = 200

    def to_spec(self) -> CameraSpec:
        """What the use case takes; an id is made of the name where none is given."""
        return CameraSpec(
            camera_id=self.id or (slug(self.name) if self.name else None) or None,
            name=self.name or "",
            intrinsics=self.intrinsics.to_value(),
            prior_pose=self.prior_pose.to_value(),
            frame_rate_hz=self.frame_rate_hz,
            walking_speed_mean_mps=self.walking_speed.mean_mps,
            walking_speed_sd_mps=self.walking_speed.sd_mps,
            reference_tracks=self.reference_tracks,
        )


class CameraPatch(Body):
    """What to change of a camera; fields left out stay."""

    name: CameraName | None = None
    intrinsics: IntrinsicsBody | None = None
    prior_pose: PriorPoseBody | None = None
    frame_rate_hz: FrameRate | None = None
    walking_speed: WalkingSpeedBody | None = None
    reference_tracks: ReferenceTracks | None = None


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


def slug(name: str) -> str:
    """An id made of a name: lower case, digits and hyphens."""
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")[:50]
