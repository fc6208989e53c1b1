"""Angles as clients read them: what is stored and computed in radians, told in degrees."""

import math
from collections.abc import Mapping
from typing import Any

_RAD, _DEG = "_rad", "_deg"


def degrees(radians: float) -> float:
    """An angle as people read it."""
    return math.degrees(radians)


def in_degrees(body: Mapping[str, Any]) -> dict[str, Any]:
    """A body whose fields `*_rad` are `*_deg`, in bodies within it too; the rest as it is."""
    return dict(_as_read(name, value) for name, value in body.items())


def _as_read(name: str, value: Any) -> tuple[str, Any]:
    if isinstance(value, Mapping):
        return name, in_degrees(value)
    if name.endswith(_RAD):
        return name.removesuffix(_RAD) + _DEG, None if value is None else degrees(value)
    return name, value
