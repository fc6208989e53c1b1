"""Zones and lines as operators draw them: ids and corners, and how each document has them."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from models.tracks.scaling import Scaling
from service.enums import ZoneOn
from service.errors import FieldError, MalformedError
from service.formats.scaling import read_scaling
from service.formats.zone_extent import extent_fault

MOST_ZONES, MOST_CORNERS = 100, 2_000  # of a camera; corners of all together
_LONGEST_ID = 100
_LARGEST = 1e6  # of a number; nor is it NaN
Corner = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Zone:
    """Corners in pixels, as they were drawn; two are a line. It lies on the ground or does not."""

    id: str
    on: ZoneOn
    corners: tuple[Corner, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Slot:
    """A zone's place in a document: its corners in the document's numbers, and how to change them.

    `pointer` is where it stands; `put` has other corners there, `drop` has the zone no more. `on`
    is None where the document does not say.
    """

    id: Any
    pointer: str
    corners: Any
    put: Callable[[Sequence[Corner]], None]
    drop: Callable[[], None]
    on: Any = None


def refused(pointer: str, reason: str) -> MalformedError:
    """The error of a place in a document."""
    words = f"{pointer[1:] or 'body'}: {reason}"
    return MalformedError(words, (FieldError(pointer=pointer, reason=reason),))


def scaling_of(document: Any, picture: tuple[int, int]) -> Scaling | None:
    """How the numbers of a JSON document become pixels, by its `size` or `normalised`.

    Raises:
        MalformedError: one of the two fields is malformed.
    """
    given = document if isinstance(document, dict) else {}
    try:
        return read_scaling(given.get("size"), given.get("normalised"), picture)
    except ValueError as error:
        field, _, reason = str(error).partition(": ")
        raise refused(f"/{field}", reason) from error


def scaled(
    corners: Sequence[Corner], scaling: Scaling | None, *, back: bool = False
) -> list[Corner]:
    """Corners in pixels of the image; with `back`, pixels in the numbers of the document."""
    if scaling is None:
        return list(corners)
    (fx, fy), (sx, sy) = scaling.factor, scaling.shift
    if back:
        return [((u - sx) / fx, (v - sy) / fy) for u, v in corners]
    return [(x * fx + sx, y * fy + sy) for x, y in corners]


def zones_of(
    slots: Iterable[Slot], on: ZoneOn, scaling: Scaling | None, picture: tuple[int, int]
) -> tuple[Zone, ...]:
    """The zones of a document.

    Args:
        slots: places of zones in the document.
        on: surface of a zone that does not name one.
        scaling: from the document's numbers to pixels; None if they are pixels.
        picture: width and height of the image.

    Raises:
        MalformedError: with the place, the limit and the value received.
    """
    zones: dict[str, Zone] = {}
    count = 0
    for slot in slots:
        if not isinstance(slot.id, str) or not 0 < len(slot.id) <= _LONGEST_ID or "\0" in slot.id:
            needed = f"an id of 1 to {_LONGEST_ID} characters is needed"
            raise refused(slot.pointer, f"{needed}, got {slot.id!r:.40}")
        if slot.id in zones:
            raise refused(slot.pointer, f"each zone needs its own id, got {slot.id!r} twice")
        if slot.on is not None and slot.on not in list(ZoneOn):
            needed = f"on: one of {', '.join(ZoneOn)} is needed"
            raise refused(slot.pointer, f"{needed}, got {slot.on!r:.40}")
        given = _numbers(slot)
        count += len(given)
        if len(zones) >= MOST_ZONES or count > MOST_CORNERS:
            most = f"at most {MOST_ZONES} zones with {MOST_CORNERS} corners together are accepted"
            raise refused(slot.pointer, f"{most}, got more")
        corners = tuple(scaled(given, scaling))
        reason = extent_fault(given, corners, picture)
        if reason is not None:
            raise refused(slot.pointer, reason)
        zones[slot.id] = Zone(id=slot.id, on=ZoneOn(slot.on or on), corners=corners)
    return tuple(zones.values())


def _numbers(slot: Slot) -> list[Corner]:
    given = slot.corners
    if not isinstance(given, list) or len(given) < 2:
        raise refused(slot.pointer, f"a list of 2 corners or more is needed, got {given!r:.40}")
    for each in given:
        fine = isinstance(each, list | tuple) and len(each) == 2
        if not fine or not all(type(x) in (int, float) and abs(x) <= _LARGEST for x in each):
            needed = "corners of two finite numbers are needed"
            raise refused(slot.pointer, f"{needed}, got {each!r:.40}")
    return [(each[0], each[1]) for each in given]
