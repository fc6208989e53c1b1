"""Lenses and poses in their forms on the wire."""

import math
from dataclasses import asdict
from typing import Annotated, Self

import numpy as np
from pydantic import BaseModel, Field, model_validator

from models.errors import CalibrationError
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose, pose_from_centre, pose_from_matrices
from models.geometry.rotation import nearest_rotation, rotation_from_quaternion
from service.api.fields import Body, Finite, Triple

# Of numbers beyond these nothing can be computed, let alone drawn.
_HIGHEST_M, _FARTHEST_M = 10_000.0, 1e8

FocalLength = Annotated[Finite, Field(ge=1, le=1e6)]
Centre = Annotated[Finite, Field(ge=-1e6, le=1e6)]
Tilt = Annotated[Finite, Field(ge=-90, le=90)]


class IntrinsicsBody(Body):
    """Intrinsics in pixels; distortion k1, k2, p1, p2, k3."""

    width: int = Field(gt=0, le=100_000)
    height: int = Field(gt=0, le=100_000)
    fx: FocalLength
    fy: FocalLength
    cx: Centre
    cy: Centre
    distortion: list[Annotated[Finite, Field(ge=-1e4, le=1e4)]] = Field(
        default=[0.0] * 5, min_length=5, max_length=5
    )

    def to_value(self) -> Intrinsics:
        """The lens as a value."""
        k1, k2, p1, p2, k3 = self.distortion
        fields = self.model_dump(exclude={"distortion"})
        return Intrinsics(**fields, distortion=(k1, k2, p1, p2, k3))

    @classmethod
    def from_value(cls, value: Intrinsics) -> Self:
        """The body of a lens."""
        return cls.model_validate(asdict(value))


class PriorPoseBody(Body):
    """A pose in one of four forms: angles, R and t, rvec and tvec, quaternion and position."""

    height_m: Finite | None = None
    tilt_deg: Tilt | None = None
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
        given = {name for name in self.model_fields_set if getattr(self, name) is not None}
        needed = [{"height_m", "tilt_deg"}, *forms[1:]]
        if not any(need <= given <= form for need, form in zip(needed, forms, strict=True)):
            raise ValueError(
                "one form is needed: height_m and tilt_deg, rotation and translation_m, rvec and "
                f"tvec_m, or quaternion_wxyz and position_m; got {sorted(given)}"
            )
        try:
            pose = self.to_value()
        except CalibrationError as error:
            raise ValueError(str(error)) from error
        limits = {"height_m": _HIGHEST_M, "x_m": _FARTHEST_M, "y_m": _FARTHEST_M}
        for name, limit in limits.items():
            value = getattr(pose, name)
            if not abs(value) <= limit:  # nor is it NaN
                raise ValueError(f"{name}: at most {limit:g} m are taken, got {value:g}")
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
