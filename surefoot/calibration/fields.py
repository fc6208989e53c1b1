"""Numbers of a document by the names that tools give them."""

import math
import re
from collections.abc import Iterable, Mapping
from typing import Any

from surefoot.calibration.value import CalibrationFileError

_SEPARATORS = re.compile(r"[\s,;\[\]()]+")
_MOST = 4096  # numbers of one field
_SIZES = ("image_size", "imageSize", "img_size", "resolution", "size", "img_shape")
_WIDTHS = ("image_width", "image_Width", "imageWidth", "width", "frameWidth", "w")
_HEIGHTS = ("image_height", "image_Height", "imageHeight", "height", "frameHeight", "h")
_MOST_PIXELS = 100_000


def named(document: Mapping[str, Any], names: Iterable[str]) -> str | None:
    """The first of the names that the document has."""
    return next((name for name in names if document.get(name) is not None), None)


def numbers(value: Any) -> list[float] | None:
    """Numbers of a list (nested or not), a matrix with `data`, or a text; None if it has others."""
    found: list[float] = []
    return found if _collect(value, found) else None


def field_numbers(
    document: Mapping[str, Any], names: Iterable[str], counts: Iterable[int]
) -> list[float] | None:
    """Numbers of the first field that is there; None if none is.

    Raises:
        CalibrationFileError: it has another count of numbers, or others than finite ones.
    """
    name = named(document, names)
    if name is None:
        return None
    found = numbers(document[name])
    wanted = " or ".join(map(str, counts))
    if found is None:
        raise CalibrationFileError(f"{name}: must have {wanted} finite numbers (got other values)")
    if len(found) not in counts or not _is_whole(document[name], len(found)):
        raise CalibrationFileError(f"{name}: must have {wanted} numbers (got {len(found)})")
    return found


def _is_whole(value: Any, count: int) -> bool:
    """True unless a matrix has other rows and columns than it has numbers."""
    if not isinstance(value, Mapping):
        return True
    sides = numbers([value.get("rows", "1"), value.get("cols", str(count))])
    return sides is not None and len(sides) == 2 and sides[0] * sides[1] == count


def image_size(document: Mapping[str, Any]) -> tuple[int, int] | None:
    """The image size (width, height); None if the document has none.

    Raises:
        CalibrationFileError: a side is no whole number from 1 to 100000.
    """
    name = named(document, _SIZES)
    sides = None if name is None else numbers(document[name])
    if sides is None or len(sides) != 2:
        width, height = named(document, _WIDTHS), named(document, _HEIGHTS)
        if width is None or height is None:
            return None
        found = numbers([document[width], document[height]])
        name, sides = f"{width}, {height}", found or []
    if len(sides) != 2 or not all(0 <= side <= _MOST_PIXELS for side in sides):
        raise CalibrationFileError(f"{name}: must be from 1 to {_MOST_PIXELS} px (got {sides})")
    if not all(sides):
        return None  # unknown, as some drivers write it
    return round(sides[0]), round(sides[1])


def _collect(value: Any, found: list[float]) -> bool:
    if isinstance(value, dict):
        return "data" in value and _collect(value["data"], found)
    if isinstance(value, list):
        return all(_collect(each, found) for each in value)
    if isinstance(value, str):
        parts = [part for part in _SEPARATORS.split(value) if part]
    elif isinstance(value, int | float) and not isinstance(value, bool):
        parts = [value]
    else:
        return False
    try:
        found += map(float, parts)
    except (ValueError, OverflowError):
        return False
    return len(found) <= _MOST and all(math.isfinite(each) for each in found)
