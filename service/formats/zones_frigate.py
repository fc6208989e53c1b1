"""Zones in a Frigate configuration: `coordinates: x,y,x,y` in shares of the picture.

Source: docs.frigate.video, "Zones". Motion masks are of what the picture shows, clocks and trees
alike, and stay as they are.
"""

from collections.abc import Iterator, Sequence
from typing import Any

from service.formats.zones import Corner, Slot, Zone, refused

_DIGITS = 5  # a hundredth of a pixel


def frigate_slots(document: Any, camera_id: str) -> Iterator[Slot]:
    """The zones of a whole configuration's camera, of one camera's part, or of `zones` alone."""
    part, pointer = _camera_part(document, camera_id)
    zones = part.get("zones") if isinstance(part, dict) else None
    if not isinstance(zones, dict):
        raise refused(pointer, "Frigate's zones are needed, a mapping of names")
    for name in list(zones):
        zone, place = zones[name], f"{pointer}/zones/{name}"
        if not isinstance(zone, dict):
            raise refused(place, "a mapping with coordinates is needed")
        given = zone.get("coordinates")

        def put(corners: Sequence[Corner], zone: Any = zone, given: Any = given) -> None:
            pairs = [f"{round(x, _DIGITS)},{round(y, _DIGITS)}" for x, y in corners]
            zone["coordinates"] = pairs if isinstance(given, list) else ",".join(pairs)

        def drop(name: Any = name) -> None:
            del zones[name]

        corners = _corners(given, place)
        yield Slot(id=name, pointer=f"{place}/coordinates", corners=corners, put=put, drop=drop)


def frigate_template(zones: Sequence[Zone]) -> Any:
    """A configuration of zones, whose coordinates are to be put in; Frigate has no lines."""
    areas = [zone for zone in zones if len(zone.corners) > 2]
    return {"zones": {zone.id: {"coordinates": "0,0,0,0"} for zone in areas}}


def _camera_part(document: Any, camera_id: str) -> tuple[Any, str]:
    cameras = document.get("cameras") if isinstance(document, dict) else None
    if not isinstance(cameras, dict):
        return document, ""
    name = camera_id if camera_id in cameras else next(iter(cameras), "")
    if name != camera_id and len(cameras) != 1:
        needed = f"one camera, or one that is called {camera_id}, is needed"
        raise refused("/cameras", f"{needed}, got {len(cameras)} others")
    return cameras.get(name), f"/cameras/{name}"


def _corners(given: Any, pointer: str) -> list[Corner]:
    """Numbers of one text, or of a text a corner."""
    text = ",".join(map(str, given)) if isinstance(given, list) else given
    try:
        numbers = [float(number) for number in str(text).split(",")]
    except ValueError as error:
        needed = "x,y,x,y is needed"
        raise refused(f"{pointer}/coordinates", f"{needed}, got {given!r:.40}") from error
    if len(numbers) % 2 or not all(0 <= number <= 1 for number in numbers):
        needed = "pairs of shares of the picture, 0 to 1, are needed"
        raise refused(f"{pointer}/coordinates", f"{needed}, got {given!r:.40}")
    return list(zip(numbers[::2], numbers[1::2], strict=True))
