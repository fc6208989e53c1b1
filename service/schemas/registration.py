"""The registration form: what was typed, to what the API takes, with reasons beside the fields."""

import math
import re
from dataclasses import dataclass
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, Field, ValidationError

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from service.errors import FieldError, MalformedError
from service.formats.calibration_file import CalibrationFile
from service.schemas.base import Body, Finite, Triple
from service.schemas.cameras import CameraBody
from service.schemas.geometry import IntrinsicsBody, PriorPoseBody

Made = TypeVar("Made", bound=BaseModel)
Typed = Annotated[str, Field(max_length=2000)]
_LENS = ("width", "height", "fx", "fy", "cx", "cy")
_ANGLES = ("height_m", "tilt_deg", "roll_deg", "heading_deg", "x_m", "y_m")
_NEEDED = {"width", "height", "fx", "height_m", "tilt_deg", "rotation", "translation_m"}
_SEPARATORS = re.compile(r"[\s,;\[\]()]+")


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadForm:
    """What a form says: values as far as they can be read, and what is wrong where."""

    lens: IntrinsicsBody | None
    pose: PriorPoseBody | None
    rest: dict[str, Any]
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
        """What can be read of it; fields that are needed and empty are no errors yet."""
        reader = _Reader(self)
        lens = reader.made(IntrinsicsBody, reader.lens())
        pose = reader.made(PriorPoseBody, reader.pose())
        rest: dict[str, Any] = {"name": self.name.strip() or None, "id": self.id.strip() or None}
        rest["frame_rate_hz"] = reader.number("frame_rate_hz")
        wanted = reader.number("reference_tracks")
        if wanted is not None:
            rest["reference_tracks"] = wanted
        return ReadForm(lens=lens, pose=pose, rest=rest, errors=tuple(reader.errors))

    def to_body(self) -> CameraBody:
        """The body of `POST /cameras`.

        Raises:
            MalformedError: with a reason for each field that is missing or wrong.
        """
        read = self.read()
        shown = {*_LENS[:3], *(("height_m", "tilt_deg") if self.form == "angles" else ())}
        shown |= {"rotation", "translation_m"} if self.form == "matrix" else set()
        wrong = {error.pointer for error in read.errors}
        errors = [
            *read.errors,
            *(
                FieldError(pointer=f"/{name}", reason="is needed")
                for name in sorted(shown & _NEEDED)
                if not getattr(self, name).strip() and f"/{name}" not in wrong
            ),
        ]
        if not errors:
            try:
                body = {"intrinsics": read.lens, "prior_pose": read.pose, **read.rest}
                return CameraBody.model_validate(body)
            except ValidationError as error:
                errors = [_field_error(item) for item in error.errors()]
        detail = "; ".join(f"{error.pointer[1:]}: {error.reason}" for error in errors)
        raise MalformedError(detail, tuple(errors))


class _Reader:
    """Reads fields, and keeps what is wrong with them."""

    def __init__(self, form: RegistrationForm) -> None:
        self.form = form
        self.errors: list[FieldError] = []

    def number(self, name: str) -> float | None:
        """The number in a field; None where it is empty or none."""
        text = getattr(self.form, name).strip().replace("\N{MINUS SIGN}", "-").rstrip("°")
        if not text:
            return None
        try:
            value = float(text.replace(",", "."))
        except ValueError:
            value = math.nan
        if math.isfinite(value):
            return value
        self.wrong(name, f"a number is needed, got {text[:30]!r}")
        return None

    def numbers(self, name: str, counts: tuple[int, ...]) -> list[float] | None:
        """The numbers pasted into a field; None where it is empty or has not so many."""
        parts = [part for part in _SEPARATORS.split(getattr(self.form, name)) if part]
        if not parts:
            return None
        try:
            values = [float(part) for part in parts]
        except ValueError:
            values = [math.nan]
        if len(values) in counts and all(math.isfinite(value) for value in values):
            return values
        wanted = " or ".join(str(count) for count in counts)
        self.wrong(name, f"{wanted} numbers are needed, got {len(parts)}")
        return None

    def lens(self) -> dict[str, Any] | None:
        """The lens; fy is fx and the middle the picture's where they are left empty."""
        values = {name: self.number(name) for name in _LENS}
        width, height, fx = values["width"], values["height"], values["fx"]
        distortion = self.numbers("distortion", (1, 2, 3, 4, 5)) or []
        if width is None or height is None or fx is None:
            return None
        middle = {"cx": (width - 1) / 2, "cy": (height - 1) / 2, "fy": fx}
        given = {name: value for name, value in values.items() if value is not None}
        return {**middle, **given, "distortion": [*distortion, 0.0, 0.0, 0.0, 0.0, 0.0][:5]}

    def pose(self) -> dict[str, Any] | None:
        """The pose in the form that counts."""
        if self.form.form == "angles":
            values = {name: self.number(name) for name in _ANGLES}
            if values["height_m"] is None or values["tilt_deg"] is None:
                return None
            return {name: value for name, value in values.items() if value is not None}
        turned, moved = self.numbers("rotation", (9, 3)), self.numbers("translation_m", (3,))
        if turned is None or moved is None:
            return None
        if len(turned) == 3:
            return {"rvec": turned, "tvec_m": moved}
        return {"rotation": [turned[:3], turned[3:6], turned[6:]], "translation_m": moved}

    def made(self, kind: type[Made], values: dict[str, Any] | None) -> Made | None:
        """A body of values, if they are good."""
        if values is None:
            return None
        try:
            return kind.model_validate(values)
        except ValidationError as error:
            for item in error.errors():
                found = _field_error(item, self.form.form)
                name = found.pointer[1:]
                if name != "fy" or self.form.fy.strip():  # else it is fx that is wrong
                    self.wrong(name, found.reason)
        return None

    def wrong(self, name: str, reason: str) -> None:
        """Note what is wrong with a field."""
        self.errors.append(FieldError(pointer=f"/{name}", reason=reason))


def _field_error(item: Any, form: str = "angles") -> FieldError:
    """The field that an error is of, and the reason without the words of a programmer."""
    names = [part for part in item["loc"] if isinstance(part, str)]
    reason = item["msg"].removeprefix("Value error, ").replace("Input should be", "must be")
    name = names[-1] if names else ""
    said = re.match(r"(\w+): (.*)", reason)
    if not name or name in ("intrinsics", "prior_pose"):
        name, reason = said.groups() if said else ("height_m", reason)
    if form == "matrix":
        if name == "height_m":
            reason = (
                f"R and t put the camera under the ground (height {reason.split()[-1]} m): R has "
                "to turn world into camera axes, and t is not the position but −R times it"
            )
        name = {"height_m": "translation_m", "tvec_m": "translation_m"}.get(name, "rotation")
    if name == "id":
        reason = "small letters, digits and hyphens are needed"
    return FieldError(pointer=f"/{name}", reason=reason)


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
    """What a calibration file says, as the form's fields have it."""

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
