"""Bodies out of what people type: numbers with commas, numbers pasted with brackets."""

import math
import re
from collections.abc import Callable
from typing import Any

from pydantic import Field, field_validator
from pydantic_core import ErrorDetails, PydanticCustomError

from service.api.cameras import CameraName, FrameRate, ReferenceTracks
from service.api.fields import Body, CameraId, Finite, Triple
from service.api.geometry_schemas import (
    Centre,
    FocalLength,
    IntrinsicsBody,
    PriorPoseBody,
    Tilt,
)
from service.errors import FieldError

_SEPARATORS = re.compile(r"[\s,;\[\]()]+")
# What pydantic finds wrong, in the words of who types; `got` is what was typed.
_REASONS = {
    "missing": "is needed",
    "int_from_float": "a whole number is needed, got {got}",
    "greater_than": "more than {gt:g} is needed, got {got}",
    "greater_than_equal": "at least {ge:g} is needed, got {got}",
    "less_than_equal": "at most {le:g} is taken, got {got}",
    "string_too_long": "at most {max_length} letters are taken",
    "string_pattern_mismatch": "small letters, digits and hyphens are needed",
}
# The field of the form that what a body makes of R and t is typed into.
_OF_MATRIX = {
    "rvec": "rotation",
    **dict.fromkeys(("tvec_m", "height_m", "x_m", "y_m"), "translation_m"),
}
_UNDER_GROUND = (
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
        "no_number", "a number is needed, got {got}", {"got": repr(text.strip()[:30])}
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
        wanted = " or ".join(str(count) for count in counts)
        said = {"wanted": wanted, "got": len(parts)}
        raise PydanticCustomError("no_numbers", "{wanted} numbers are needed, got {got}", said)

    return read


class TypedLens(IntrinsicsBody):
    """A lens; fy is fx and the middle the picture's where they are left empty."""

    fy: FocalLength = Field(default_factory=lambda said: said["fx"])
    cx: Centre = Field(default_factory=lambda said: (said["width"] - 1) / 2)
    cy: Centre = Field(default_factory=lambda said: (said["height"] - 1) / 2)

    _typed = field_validator("width", "height", "fx", "fy", "cx", "cy", mode="before")(_number)

    @field_validator("distortion", mode="before")
    @classmethod
    def _filled_up(cls, text: str) -> list[float]:
        return [*_numbers(1, 2, 3, 4, 5)(text), 0.0, 0.0, 0.0, 0.0][:5]


class TypedAngles(PriorPoseBody):
    """A pose by height and angles."""

    height_m: Finite
    tilt_deg: Tilt

    _typed = field_validator(
        "height_m", "tilt_deg", "roll_deg", "heading_deg", "x_m", "y_m", mode="before"
    )(_number)


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
    frame_rate_hz: FrameRate | None = None
    reference_tracks: ReferenceTracks = 200

    _typed = field_validator("frame_rate_hz", "reference_tracks", mode="before")(_number)


def field_error(item: ErrorDetails) -> FieldError:
    """The field that an error is of, and the reason without the words of a programmer."""
    said: dict[str, Any] = item.get("ctx", {})
    if item["type"] == "value_error":  # of all fields together: it begins with a field's name
        name, _, reason = str(said["error"]).partition(": ")
        return FieldError(pointer=f"/{name}", reason=reason)
    reason = _REASONS.get(item["type"], item["msg"])
    return FieldError(
        pointer=f"/{item['loc'][0]}", reason=reason.format(**{"got": _brief(item["input"]), **said})
    )


def of_matrix(error: FieldError) -> FieldError:
    """The same of the field that R and t were typed into."""
    name = error.pointer[1:]
    reason = error.reason
    if name == "height_m" and not reason.startswith("at most"):
        reason = _UNDER_GROUND.format(height=reason.split()[-1])
    return FieldError(pointer=f"/{_OF_MATRIX.get(name, name)}", reason=reason)


def _brief(value: object) -> str:
    return f"{value:.10g}" if isinstance(value, float) else f"{value!r:.30}"
