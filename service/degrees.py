"""Angles as clients read them: what is stored and computed in radians, told in degrees."""

import math
from collections.abc import Mapping
from typing import Any

_RAD, _DEG = "_rad", "_deg"


def in_degrees(body: Mapping[str, Any]) -> dict[str, Any]:
    """A body whose fields `*_rad` are `*_deg`, in bodies within it too; the rest as it is."""
    return dict(_as_read(name, value) for name, value in body.items())


def _as_read(name: str, value: Any) -> tuple[str, Any]:
    if isinstance(value, Mapping):
        return name, in_degrees(value)
    if isinstance(value, list) and value and all(isinstance(each, Mapping) for each in value):
        return name, [in_degrees(each) for each in value]
    if not name.endswith(_RAD):
        return name, value
    if isinstance(value, list | tuple):
        value = [math.degrees(each) for each in value]
    elif value is not None:
        value = math.degrees(value)
    return name.removesuffix(_RAD) + _DEG, value
