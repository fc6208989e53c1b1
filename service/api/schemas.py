"""Fields, lenses and poses in their forms on the wire, and the classes that bodies are of."""

import math
from dataclasses import asdict
from datetime import UTC, datetime
from typing import Annotated, Any, Self

import numpy as np
from pydantic import (
    AfterValidator,
    AwareDatetime,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ModelWrapValidatorHandler,
    PrivateAttr,
    StringConstraints,
    ValidationInfo,
    field_validator,
    model_validator,
)

from models.errors import ShapeError
from models.geometry.ground_homography import inverse_homography, pose_from_homography
from models.geometry.intrinsics import Intrinsics, Projection, coefficients_of
from models.geometry.lens_checks import check_lens
from models.geometry.lens_forms import lens_of
from models.geometry.pose import CameraPose, pose_from_centre, pose_from_matrices
from models.geometry.rotation import (
    Array,
    nearest_rotation,
    rotation_from_quaternion,
    rotation_from_vector,
)
from service.api.ignored import note_ignored
from service.degrees import in_degrees
from service.enums import ReferenceState
from service.reasons import CODES
from surefoot.times import restore_plus

_EARLIEST, _LATEST = datetime(1970, 1, 1, tzinfo=UTC), datetime(9999, 1, 1, tzinfo=UTC)
# Of numbers beyond these nothing can be computed, let alone drawn.
_HIGHEST_M, _FARTHEST_M = 10_000.0, 1e8


def _checked_moment(value: datetime) -> datetime:
    # In UTC, the first and the last hours that a datetime can say are none any more.
    if not _EARLIEST <= value <= _LATEST:
        raise ValueError(f"a time from 1970 to 9998 is needed, got {value.isoformat()}")
    return value


def _without_nul(value: str) -> str:
    # PostgreSQL has no text with one.
    if "\0" in value:
        raise ValueError("text without NUL characters is needed")
    return value


def _with_plus(value: object) -> object:
    return restore_plus(value) if isinstance(value, str) else value


Moment = Annotated[AwareDatetime, BeforeValidator(_with_plus), AfterValidator(_checked_moment)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Triple = Annotated[list[Finite], Field(min_length=3, max_length=3)]
Text = Annotated[str, AfterValidator(_without_nul)]
CameraId = Annotated[str, StringConstraints(pattern=r"^[a-z0-9][a-z0-9-]{0,62}$")]
Who = Annotated[str, StringConstraints(min_length=1, max_length=200)]
PictureSide = Annotated[int, Field(gt=0, le=100_000)]
FieldOfView = Annotated[Finite, Field(ge=1, le=170)]
Millimetres = Annotated[Finite, Field(ge=0.1, le=10_000)]
SensorSize = Annotated[list[Millimetres], Field(min_length=2, max_length=2)]
Coefficient = Annotated[Finite, Field(ge=-1e4, le=1e4)]
FocalLength = Annotated[Finite, Field(ge=1, le=1e6)]
Centre = Annotated[Finite, Field(ge=-1e6, le=1e6)]
Tilt = Annotated[Finite, Field(ge=-90, le=90)]
# Beside every `reason`: its code, and the numbers and names that belong to it.
ReasonCode = Annotated[
    str,
    Field(
        description="code of the first of the reasons; null where there is none",
        json_schema_extra={"enum": list(CODES)},
    ),
]
ReasonValues = Annotated[
    dict[str, Any],
    Field(description="its numbers, with the unit in their names, and names; may be empty"),
]


class Body(BaseModel):
    """A request body; its answer names unknown fields, which are misspelt or a newer client's."""

    _ignored: list[str] = PrivateAttr(default_factory=list)

    @model_validator(mode="wrap")
    @classmethod
    def _name_unknown(cls, value: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        body = handler(value)
        if isinstance(value, dict):
            names = {field: info.alias or field for field, info in cls.model_fields.items()}
            unknown = [name for name in value if name not in names.values()]
            within = [
                f"{name}/{inner}"
                for field, name in names.items()
                if isinstance(part := getattr(body, field), Body)
                for inner in part._ignored
            ]
            body._ignored = unknown + within
            if body._ignored:
                note_ignored(body._ignored)
        return body

    @field_validator("*")
    @classmethod
    def _no_nul(cls, value: object) -> object:
        return _without_nul(value) if isinstance(value, str) else value


class Out(BaseModel):
    """A body of an answer, made of a value or a record by its attributes."""

    model_config = ConfigDict(from_attributes=True)

    @classmethod
    def of(cls, value: object, **others: Any) -> Self:
        """The body of what has its fields as attributes, all but the others."""
        own = {name: getattr(value, name) for name in cls.model_fields.keys() - others}
        return cls.model_validate({**own, **others})


class IntrinsicsOut(Body):
    """Intrinsics in pixels; distortion k1, k2, p1, p2, k3, or of a fisheye k1, k2, k3, k4."""

    width: PictureSide
    height: PictureSide
    fx: FocalLength
    fy: FocalLength
    cx: Centre
    cy: Centre
    projection: Projection = Projection.PERSPECTIVE
    distortion: list[Coefficient] = Field(
        default_factory=lambda given: [0.0] * len(coefficients_of(given["projection"])),
        min_length=4,
        max_length=5,
    )


class IntrinsicsBody(IntrinsicsOut):
    """Intrinsics that a camera can have, in pixels.

    The principal point (cx, cy) is within the image and the distortion does not fold back within
    half of the image's shorter side from it.
    """

    @field_validator("distortion")
    @classmethod
    def _as_many(cls, value: list[float], info: ValidationInfo) -> list[float]:
        names = coefficients_of(info.data.get("projection", Projection.PERSPECTIVE))
        if len(value) != len(names):
            raise ValueError(
                f"must have {len(names)} numbers, {', '.join(names)} (got {len(value)})"
            )
        return value

    @model_validator(mode="after")
    def _possible(self) -> Self:
        check_lens(self.to_value())
        return self

    def to_value(self) -> Intrinsics:
        """The lens as a value."""
        return Intrinsics(**self.model_dump())


class FisheyeBody(Body):
    """A fisheye as `cv2.fisheye` calibrates it; square pixels and the middle where left out."""

    fx: FocalLength
    fy: FocalLength | None = None
    cx: Centre | None = None
    cy: Centre | None = None
    distortion: list[Coefficient] = Field(default=[0.0] * 4, min_length=4, max_length=4)


class LensBody(Body):
    """A lens as installers know it: by its field of view, by millimetres, or as a fisheye.

    Either `hfov_deg`, from the left edge of the picture to the right, or `focal_mm` with
    `sensor_mm`, the sensor's width and height, both without distortion; or `fisheye`.
    """

    width: PictureSide
    height: PictureSide
    hfov_deg: FieldOfView | None = None
    focal_mm: Millimetres | None = None
    sensor_mm: SensorSize | None = None
    fisheye: FisheyeBody | None = None

    @model_validator(mode="after")
    def _one_form(self) -> Self:
        check_lens(self.to_value())
        return self

    def to_value(self) -> Intrinsics:
        """The lens in pixels."""
        return lens_of(**self.model_dump())


_MEASURABLE = {"height_m", "tilt_deg", "roll_deg"}


Matrix = Annotated[list[Triple], Field(min_length=3, max_length=3)]


class PriorPoseBody(Body):
    """A pose in one of six forms.

    Height and angles; R and t; rvec and tvec; quaternion and position; or a homography from the
    ground, (x, y, 1) in metres, to undistorted pixels (u, v, 1) of the lens, or from there to the
    ground. Before a camera has a prior pose, measured numbers of height, tilt and roll are enough.
    """

    height_m: Finite | None = None
    tilt_deg: Tilt | None = None
    roll_deg: Annotated[Finite, Field(ge=-180, le=180)] = 0.0
    heading_deg: Annotated[Finite, Field(ge=-360, le=360)] = 0.0
    x_m: Finite = 0.0
    y_m: Finite = 0.0
    rotation: Matrix | None = None
    translation_m: Triple | None = None
    rvec: Triple | None = None
    tvec_m: Triple | None = None
    quaternion_wxyz: Annotated[list[Finite], Field(min_length=4, max_length=4)] | None = None
    position_m: Triple | None = None
    homography_image_from_ground: Matrix | None = None
    homography_ground_from_image: Matrix | None = None

    @model_validator(mode="after")
    def _one_form(self) -> Self:
        forms = [
            {"height_m", "tilt_deg", "roll_deg", "heading_deg", "x_m", "y_m"},
            {"rotation", "translation_m"},
            {"rvec", "tvec_m"},
            {"quaternion_wxyz", "position_m"},
            {"homography_image_from_ground"},
            {"homography_ground_from_image"},
        ]
        given = {name for name in self.model_fields_set if getattr(self, name) is not None}
        if self.measured:
            return self
        needed = [{"height_m", "tilt_deg"}, *forms[1:]]
        if not any(need <= given <= form for need, form in zip(needed, forms, strict=True)):
            raise ValueError(
                "must have one form: height_m and tilt_deg, rotation and translation_m, rvec and "
                "tvec_m, quaternion_wxyz and position_m, homography_image_from_ground, or "
                f"homography_ground_from_image (got {', '.join(sorted(given)) or 'none'})"
            )
        if self.homography is None:  # which is checked with its lens
            self.check_place(self.to_value())
        return self

    @staticmethod
    def check_place(pose: CameraPose) -> CameraPose:
        """Return a pose that is not too far away to compute with.

        Raises:
            ShapeError: naming the number.
        """
        limits = {"height_m": _HIGHEST_M, "x_m": _FARTHEST_M, "y_m": _FARTHEST_M}
        for name, limit in limits.items():
            value = getattr(pose, name)
            if not abs(value) <= limit:  # nor is it NaN
                raise ShapeError(f"{name}: at most {limit:g} m are taken, got {value:g}")
        return pose

    @property
    def homography(self) -> Array | None:
        """The homography (3, 3) from the ground to the image, if the pose is given by one.

        Raises:
            DegenerateGeometryError: it has no inverse.
        """
        if self.homography_ground_from_image is None:
            given = self.homography_image_from_ground
            return None if given is None else np.array(given)
        return inverse_homography(np.array(self.homography_ground_from_image))

    @property
    def measured(self) -> dict[str, float]:
        """What was measured of a pose that is not whole, in metres and radians; else nothing."""
        given = {name for name in self.model_fields_set if getattr(self, name) is not None}
        if not given or not given < _MEASURABLE or {"height_m", "tilt_deg"} <= given:
            return {}
        found = {name: float(getattr(self, name)) for name in given}
        if not 0 < found.get("height_m", 1.0) <= _HIGHEST_M:
            raise ValueError(
                f"height_m: above 0 and at most {_HIGHEST_M:g} m are taken, got {self.height_m:g}"
            )
        return {
            name.replace("_deg", "_rad"): math.radians(value) if name.endswith("_deg") else value
            for name, value in found.items()
        }

    def to_value(self, lens: Intrinsics | None = None) -> CameraPose:
        """The pose as a value, where it is whole; of a homography by the lens.

        Raises:
            CalibrationError: no camera has such a pose, or the homography contradicts the lens.
        """
        homography = self.homography
        if homography is not None:
            assert lens is not None
            return self.check_place(pose_from_homography(homography, lens))
        if self.rotation is not None:
            rotation = nearest_rotation(self.rotation)
            return pose_from_matrices(rotation, np.array(self.translation_m))
        if self.rvec is not None:
            return pose_from_matrices(rotation_from_vector(self.rvec), np.array(self.tvec_m))
        if self.quaternion_wxyz is not None:
            rotation = rotation_from_quaternion(self.quaternion_wxyz)
            return pose_from_centre(rotation, np.array(self.position_m))
        assert self.height_m is not None
        assert self.tilt_deg is not None
        return CameraPose.of_degrees(
            height_m=self.height_m,
            tilt_deg=self.tilt_deg,
            roll_deg=self.roll_deg,
            heading_deg=self.heading_deg,
            x_m=self.x_m,
            y_m=self.y_m,
        )


# Of each parameter of a pose.
POSE_FIELDS = {
    **{"height": "height_m", "tilt": "tilt_deg"},
    **{"roll": "roll_deg", "heading": "heading_deg"},
}


class AlternativeOut(BaseModel):
    """Another pose that explains the tracks: its weight among all that do."""

    height_m: float
    tilt_deg: float
    roll_deg: float
    heading_deg: float
    weight: float


class QuestionOut(Out):
    """A question about the input of a camera: what may be a mistake, and how to fix it.

    `field` is the suspect. Each of `fixes` is a body of `PATCH /cameras/{id}` that fixes it, the
    most likely first; `keep` is the body that confirms the input as it is.
    """

    field: str | None
    text: str
    fixes: list[dict[str, Any]] = []
    keep: dict[str, Any] | None = None


class SinceOut(BaseModel):
    """The times between which a camera moved: it stood at `after` and had moved by `before`."""

    after: datetime | None
    before: datetime | None


class ReferenceOut(Out):
    """How much of the reference period has been seen.

    `counted` of `wanted` people, each once: of `tracks`, `pieces` go on others' walks. They are of
    so many different `hours` of date and time. Pieces and hours are those of the last look.
    """

    state: ReferenceState
    tracks: int
    counted: int
    pieces: int
    hours: int
    wanted: int
    walking_speed_mps: float | None


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
            **in_degrees(asdict(pose)),
            quaternion_wxyz=pose.quaternion_wxyz.tolist(),
            rotation=pose.rotation.tolist(),
            translation_m=pose.translation_m.tolist(),
        )
