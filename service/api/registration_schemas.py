"""The registration form: what was typed, to what the API takes, with reasons beside the fields."""

from dataclasses import dataclass
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, Field, ValidationError

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from service.api.cameras import CameraBody
from service.api.fields import Body, Finite, Triple
from service.api.geometry_schemas import IntrinsicsBody, PriorPoseBody
from service.api.typed_schemas import (
    TypedAngles,
    TypedLens,
    TypedMatrix,
    TypedRest,
    field_error,
    of_matrix,
)
from service.errors import FieldError, MalformedError
from service.formats.calibration_file import CalibrationFile

Made = TypeVar("Made", bound=BaseModel)
Typed = Annotated[str, Field(max_length=2000)]
_FOLLOWS = "default_factory_not_called"  # of another error, which is told


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadForm:
    """Values of a form as far as they can be read, and what is wrong or missing where."""

    lens: IntrinsicsBody | None
    pose: PriorPoseBody | None
    rest: TypedRest | None
    errors: tuple[FieldError, ...]


class RegistrationForm(Body):
    """The fields as they were typed; `form` says which of the two poses counts."""

    form: Literal["angles", "matrix"] = "angles"
    name: Typed = ""
    id: Typed = ""
    width: Typed = ""
    height: Typed = ""
    fx: Typed = ""
    fy: Typed = ""
    cx: Typed = ""
    cy: Typed = ""
    distortion: Typed = ""
    height_m: Typed = ""
    tilt_deg: Typed = ""
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
        lens = self._read(TypedLens, errors)
        pose: PriorPoseBody | None = None
        if self.form == "angles":
            pose = self._read(TypedAngles, errors)
        elif (matrix := self._read(TypedMatrix, errors)) is not None:
            wrong: list[FieldError] = []
            pose = _made(PriorPoseBody, matrix.to_fields(), wrong)
            errors += [of_matrix(error) for error in wrong]
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

    def _read(self, kind: type[Made], errors: list[FieldError]) -> Made | None:
        """A kind, made of those of its fields that are not empty."""
        typed = {name: str(getattr(self, name, "")).strip() for name in kind.model_fields}
        return _made(kind, {name: text for name, text in typed.items() if text}, errors)


def _made(kind: type[Made], values: dict[str, Any], errors: list[FieldError]) -> Made | None:
    try:
        return kind.model_validate(values)
    except ValidationError as error:
        found = error.errors(include_url=False)
        errors += [field_error(item) for item in found if item["type"] != _FOLLOWS]
        return None


class PreviewBody(Body):
    """The form so far, and recorded tracks to try it with: `[frame, u, v]` each point."""

    fields: RegistrationForm
    tracks: Annotated[
        list[Annotated[list[Triple], Field(max_length=200)]], Field(max_length=200)
    ] = []


class SayingOut(BaseModel):
    """Something about the pose in words, and what may mend it: a field and another value."""

    kind: str
    text: str
    field: str | None = None
    value: str | None = None


class PreviewOut(BaseModel):
    """The pictures of a pose, what is to say of it, and what is wrong with the fields."""

    picture: str
    ground: str
    says: list[SayingOut]
    errors: dict[str, str]


class TriedOut(BaseModel):
    """Tracks to send with each preview, thinned, and what was read."""

    tracks: list[list[list[Finite]]]
    text: str


class FilledOut(BaseModel):
    """A calibration file as the form's fields have it."""

    fields: dict[str, str]
    text: str

    @classmethod
    def from_value(cls, value: CalibrationFile) -> "FilledOut":
        """The fields of a calibration."""
        fields: dict[str, str] = {}
        if value.size is not None:
            fields |= {"width": str(value.size[0]), "height": str(value.size[1])}
        if value.matrix is not None:
            fx, _, cx, _, fy, cy = value.matrix[:6]
            fields |= {"fx": _say(fx), "fy": _say(fy), "cx": _say(cx), "cy": _say(cy)}
        if value.distortion is not None:
            fields["distortion"] = ", ".join(_say(number) for number in value.distortion)
        if value.rotation is not None:
            rows = [value.rotation[n : n + 3] for n in range(0, len(value.rotation), 3)]
            fields["rotation"] = "\n".join("  ".join(_say(n) for n in row) for row in rows)
        if value.translation is not None:
            fields["translation_m"] = "  ".join(_say(number) for number in value.translation)
        if "rotation" in fields and "translation_m" in fields:
            fields["form"] = "matrix"
        names = {"fx": "lens", "width": "picture size", "rotation": "rotation"}
        names["translation_m"] = "translation"
        read = ", ".join(word for name, word in names.items() if name in fields)
        missing = ", ".join(word for name, word in names.items() if name not in fields)
        return cls(
            fields=fields,
            text=f"Read: {read}." + (f" Not in the file: {missing}." if missing else ""),
        )


def values_of(read: ReadForm) -> tuple[Intrinsics | None, CameraPose | None]:
    """The lens and the pose of a form as values."""
    lens = None if read.lens is None else read.lens.to_value()
    return lens, None if read.pose is None else read.pose.to_value()


def _say(number: float) -> str:
    return f"{number:.10g}"
