"""Zones and lines as operators draw them: ids and corners, and how each document has them."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from service.enums import ZoneOn
from service.errors import FieldError, MalformedError

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
    """The error of something in a document."""
    words = f"{pointer[1:] or 'body'}: {reason}"
    return MalformedError(words, (FieldError(pointer=pointer, reason=reason),))


def zones_of(
    slots: Iterable[Slot],
    on: ZoneOn,
    to_pixel: Callable[[Corner], Corner],
    picture: tuple[int, int],
) -> tuple[Zone, ...]:
    """The zones of a document.

    They lie `on` what is named where it does not say.

    Raises:
        MalformedError: with the place, the limit and what came.
    """
    zones: dict[str, Zone] = {}
    count = 0
    for slot in slots:
        if not isinstance(slot.id, str) or not 0 < len(slot.id) <= _LONGEST_ID or "\0" in slot.id:
            needed = f"an id of 1 to {_LONGEST_ID} characters is needed"
            raise refused(slot.pointer, f"{needed}, got {slot.id!r:.40}")
        if slot.id in zones:
            raise refused(slot.pointer, f"each zone has an id of its own, got {slot.id!r} twice")
        if slot.on is not None and slot.on not in list(ZoneOn):
            needed = f"on: one of {', '.join(ZoneOn)} is needed"
            raise refused(slot.pointer, f"{needed}, got {slot.on!r:.40}")
        corners = tuple(to_pixel(each) for each in _numbers(slot))
        for corner in corners:
            if not all(-side <= x <= 2 * side for x, side in zip(corner, picture, strict=True)):
                needed = f"corners within a picture's size of it, {picture}, are needed"
                got = f"{corner[0]:.6g}, {corner[1]:.6g}"
                raise refused(slot.pointer, f"{needed}, got pixel {got}")
        zones[slot.id] = Zone(id=slot.id, on=ZoneOn(slot.on or on), corners=corners)
        count += len(corners)
        if len(zones) > MOST_ZONES or count > MOST_CORNERS:
            most = f"at most {MOST_ZONES} zones with {MOST_CORNERS} corners together are taken"
            raise refused(slot.pointer, f"{most}, got more")
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
