"""The registration form: what was typed, to what the API takes, with reasons beside the fields."""

import math
import re
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, Field, ValidationError, ValidationInfo, field_validator
from pydantic_core import PydanticCustomError

from models.geometry.intrinsics import Projection, coefficients_of
from service.api.cameras import CameraBody, FrameRate, ReferenceTracks
from service.api.labels import CameraName, Site, Tags
from service.api.schemas import (
    Body,
    CameraId,
    Centre,
    FieldOfView,
    Finite,
    FocalLength,
    IntrinsicsBody,
    LensBody,
    Millimetres,
    PriorPoseBody,
    SensorSize,
    Tilt,
    Triple,
)
from service.errors import FieldError, MalformedError
from service.wording.body_errors import field_errors
from service.wording.language import N_, _

Made = TypeVar("Made", bound=BaseModel)
Typed = Annotated[str, Field(max_length=2000)]
_SEPARATORS = re.compile(r"[\s,;\[\]()]+")
# The field of the form that what a body makes of R and t is typed into.
_OF_MATRIX = {
    "rvec": "rotation",
    **dict.fromkeys(("tvec_m", "height_m", "x_m", "y_m"), "translation_m"),
}
_UNDER_GROUND = N_(
    "R and t put the camera under the ground (height {height} m): R has to turn world into camera "
    "axes, and t is not the position but −R times it"
)


def _number(text: str) -> float:
    said = text.strip().replace("\N{MINUS SIGN}", "-").rstrip("°")
    try:
        value = float(said.replace(",", "."))
    except ValueError:
        value = math.nan
    if math.isfinite(value):
        return value
    raise PydanticCustomError(
        "no_number",
        "{said}",
        {"said": _("a number is needed, got {got!r}", got=text.strip()[:30])},
    )


def _numbers(*counts: int) -> Callable[[str], list[float]]:
    """A reader of so many numbers that were pasted."""

    def read(text: str) -> list[float]:
        parts = [part for part in _SEPARATORS.split(text) if part]
        try:
            values = [float(part) for part in parts]
        except ValueError:
            values = [math.nan]
        if len(values) in counts and all(math.isfinite(value) for value in values):
            return values
        wanted = _(" or ").join(str(count) for count in counts)
        said = _("{wanted} numbers are needed, got {got}", wanted=wanted, got=len(parts))
        raise PydanticCustomError("no_numbers", "{said}", {"said": said})

    return read


class TypedLens(IntrinsicsBody):
    """A lens; fy is fx and the middle the picture's where they are left empty."""

    fy: FocalLength = Field(default_factory=lambda said: said["fx"])
    cx: Centre = Field(default_factory=lambda said: (said["width"] - 1) / 2)
    cy: Centre = Field(default_factory=lambda said: (said["height"] - 1) / 2)

    _typed = field_validator("width", "height", "fx", "fy", "cx", "cy", mode="before")(_number)

    @field_validator("distortion", mode="before")
    @classmethod
    def _filled_up(cls, text: str, info: ValidationInfo) -> list[float]:
        count = len(coefficients_of(info.data.get("projection", Projection.PERSPECTIVE)))
        return [*_numbers(*range(1, count + 1))(text), 0.0, 0.0, 0.0, 0.0][:count]


class TypedView(LensBody):
    """A lens by its field of view."""

    hfov_deg: FieldOfView

    _typed = field_validator("width", "height", "hfov_deg", mode="before")(_number)


class TypedSensor(LensBody):
    """A lens by its focal length and its sensor, in millimetres."""

    focal_mm: Millimetres
    sensor_mm: SensorSize

    _typed = field_validator("width", "height", "focal_mm", mode="before")(_number)
    _size = field_validator("sensor_mm", mode="before")(_numbers(2))


class TypedAngles(PriorPoseBody):
    """A pose by height and angles."""

    height_m: Finite
    tilt_deg: Tilt

    _typed = field_validator(
        "height_m", "tilt_deg", "roll_deg", "heading_deg", "x_m", "y_m", mode="before"
    )(_number)


class TypedMeasured(Body):
    """What was measured of a pose that nobody knows."""

    measured_height_m: Finite | None = None
    measured_tilt_deg: Tilt | None = None
    measured_roll_deg: Annotated[Finite, Field(ge=-180, le=180)] | None = None

    _typed = field_validator(
        "measured_height_m", "measured_tilt_deg", "measured_roll_deg", mode="before"
    )(_number)

    def to_body(self, errors: list[FieldError]) -> PriorPoseBody | None:
        """The body of the pose; None where nothing was measured."""
        given = {name.removeprefix("measured_"): value for name, value in self if value is not None}
        if not given:
            return None
        wrong: list[FieldError] = []
        made = _made(PriorPoseBody, given, wrong)
        errors += [
            FieldError(pointer=f"/measured_{error.pointer[1:]}", reason=error.reason)
            for error in wrong
        ]
        return made


class TypedMatrix(Body):
    """A pose by R, or a Rodrigues vector, and t."""

    rotation: list[Finite]
    translation_m: Triple

    _rotation = field_validator("rotation", mode="before")(_numbers(9, 3))
    _translation = field_validator("translation_m", mode="before")(_numbers(3))

    def to_fields(self) -> dict[str, Any]:
        """The fields of the body of a pose."""
        turned, moved = self.rotation, self.translation_m
        if len(turned) == 3:
            return {"rvec": turned, "tvec_m": moved}
        return {"rotation": [turned[:3], turned[3:6], turned[6:]], "translation_m": moved}


class TypedRest(Body):
    """The other fields of a camera."""

    id: CameraId | None = None
    name: CameraName | None = None
    site: Site = ""
    tags: Tags = []
    frame_rate_hz: FrameRate | None = None
    reference_tracks: ReferenceTracks = 200

    _typed = field_validator("frame_rate_hz", "reference_tracks", mode="before")(_number)

    @field_validator("tags", mode="before")
    @classmethod
    def _words(cls, text: str) -> list[str]:
        return [word for word in _SEPARATORS.split(text) if word]


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadForm:
    """Values of a form as far as they can be read, and what is wrong or missing where."""

    lens: IntrinsicsBody | None
    pose: PriorPoseBody | None
    rest: TypedRest | None
    errors: tuple[FieldError, ...]


class RegistrationForm(Body):
    """The fields as they were typed; `form` and `lens_form` say which of them count."""

    form: Literal["angles", "matrix", "people"] = "angles"
    lens_form: Literal["pixels", "view", "sensor"] = "pixels"
    name: Typed = ""
    id: Typed = ""
    site: Typed = ""
    tags: Typed = ""
    width: Typed = ""
    height: Typed = ""
    fx: Typed = ""
    fy: Typed = ""
    cx: Typed = ""
    cy: Typed = ""
    projection: Typed = Projection.PERSPECTIVE
    distortion: Typed = ""
    hfov_deg: Typed = ""
    focal_mm: Typed = ""
    sensor_mm: Typed = ""
    height_m: Typed = ""
    tilt_deg: Typed = ""
    measured_height_m: Typed = ""
    measured_tilt_deg: Typed = ""
    measured_roll_deg: Typed = ""
    roll_deg: Typed = ""
    heading_deg: Typed = ""
    x_m: Typed = ""
    y_m: Typed = ""
    rotation: Typed = ""
    translation_m: Typed = ""
    frame_rate_hz: Typed = ""
    reference_tracks: Typed = ""

    def read(self) -> ReadForm:
        """Read it as far as that goes, and say what is wrong or missing."""
        errors: list[FieldError] = []
        lens = self._read_lens(errors)
        pose: PriorPoseBody | None = None
        if self.form == "angles":
            pose = self._read(TypedAngles, errors)
        elif self.form == "people":
            measured = self._read(TypedMeasured, errors)
            pose = None if measured is None else measured.to_body(errors)
        elif (matrix := self._read(TypedMatrix, errors)) is not None:
            wrong: list[FieldError] = []
            pose = _made(PriorPoseBody, matrix.to_fields(), wrong)
            errors += [_of_matrix(error) for error in wrong]
        return ReadForm(
            lens=lens, pose=pose, rest=self._read(TypedRest, errors), errors=tuple(errors)
        )

    def to_body(self) -> CameraBody:
        """The body of `POST /cameras`.

        Raises:
            MalformedError: with a reason for each field that is missing or wrong.
        """
        read = self.read()
        if read.errors or read.rest is None:
            detail = "; ".join(f"{error.pointer[1:]}: {error.reason}" for error in read.errors)
            raise MalformedError(detail, read.errors)
        rest = read.rest.model_dump()
        return CameraBody.model_validate({"intrinsics": read.lens, "prior_pose": read.pose, **rest})

    def _read_lens(self, errors: list[FieldError]) -> IntrinsicsBody | None:
        if self.lens_form == "pixels":
            return self._read(TypedLens, errors)
        kind = TypedView if self.lens_form == "view" else TypedSensor
        lens: LensBody | None = self._read(kind, errors)
        if lens is None:
            return None
        return IntrinsicsBody.model_validate(asdict(lens.to_value()))

    def _read(self, kind: type[Made], errors: list[FieldError]) -> Made | None:
        """A kind, made of those of its fields that are not empty."""
        typed = {name: str(getattr(self, name, "")).strip() for name in kind.model_fields}
        return _made(kind, {name: text for name, text in typed.items() if text}, errors)


def _made(kind: type[Made], values: dict[str, Any], errors: list[FieldError]) -> Made | None:
    try:
        return kind.model_validate(values)
    except ValidationError as error:
        errors += [_of_form(each) for each in field_errors(error.errors(include_url=False))]
        return None


def _of_form(error: FieldError) -> FieldError:
    """The error at its field of the form: the form has one for all numbers of a list."""
    return replace(error, pointer="/".join(error.pointer.split("/")[:2]))


def _of_matrix(error: FieldError) -> FieldError:
    """The same of the field that R and t were typed into."""
    name, reason = error.pointer[1:], error.reason
    got = reason.split()[-1].strip("()")
    if name == "height_m" and not float(got) > 0:
        reason = _(_UNDER_GROUND, height=got)
    return FieldError(pointer=f"/{_OF_MATRIX.get(name, name)}", reason=reason)
