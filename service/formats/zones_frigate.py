"""Zones in a Frigate configuration: `coordinates: x,y,x,y`, edited in place.

Coordinates are shares of the image or, if one of them is above 1, pixels of the camera's `detect`
stream. Motion masks belong to what the image shows (clocks, trees) and stay as they are.

Source: docs.frigate.video, "Zones"; Frigate 0.16, `get_relative_coordinates`.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import yaml

from service.formats.yaml_text import YamlText, has_anchor, is_within, value_of
from service.formats.zones import Corner, Slot, Zone, refused

_DIGITS = 5  # of a share: a hundredth of a pixel
_NAMED = 5  # cameras in an error


@dataclass(frozen=True, slots=True, kw_only=True)
class FrigateText:
    """A configuration whose zones belong to a camera; None if it is one camera's part alone."""

    yaml: YamlText
    camera: str | None

    @classmethod
    def of(cls, document: Any) -> "FrigateText":
        """Parse a document that `frigate_document` made."""
        return cls(yaml=YamlText.of(document["text"]), camera=document["camera"])


def frigate_document(text: str, camera_id: str, camera_id_of: Callable[[str], str]) -> Any:
    """The document to keep: the text, and the name that Frigate has for the camera.

    Args:
        text: a whole configuration, one camera's part, or `zones` alone.
        camera_id: whose zones are wanted.
        camera_id_of: maps a name in Frigate to a camera id.

    Raises:
        MalformedError: no camera or several match, or editing its zones would change others.
    """
    found = YamlText.of(text)
    name = None
    try:
        cameras = value_of(found.root, "cameras")
        if isinstance(cameras, yaml.MappingNode):
            names = [str(key.value) for key, _ in cameras.value]
            name = _matching(names, camera_id, camera_id_of)
        document = FrigateText(yaml=found, camera=name)
        _check_own(document)
        _detect_size(document)
    except ValueError as error:
        raise refused("", str(error)) from error
    return {"text": text, "camera": name}


def frigate_slots(document: FrigateText) -> Iterator[Slot]:
    """The zones of the camera.

    Raises:
        MalformedError: with the place, what is needed and what was received.
    """
    zones, pointer = _zones(document)
    size = _detect_size(document)
    for key, zone in zones.value:
        place = f"{pointer}/{key.value}"
        given = value_of(zone, "coordinates")
        if given is None:
            raise refused(f"{place}/coordinates", "x,y,x,y is needed, got none")
        corners, scale = _corners(given, f"{place}/coordinates", size)
        yield Slot(
            id=key.value,
            pointer=f"{place}/coordinates",
            corners=corners,
            put=_put(document.yaml, given, scale),
            drop=_drop(document.yaml, zones, key),
        )


def frigate_template(zones: Sequence[Zone]) -> Any:
    """A document of zones whose coordinates are still to be put in; Frigate has no lines."""
    areas = {zone.id: {"coordinates": "0,0,0,0"} for zone in zones if len(zone.corners) > 2}
    text = yaml.safe_dump({"zones": areas}, sort_keys=False, allow_unicode=True, width=1_000_000)
    return {"text": text, "camera": None}


def _matching(names: list[str], camera_id: str, camera_id_of: Callable[[str], str]) -> str:
    """The name of a camera: its id, a name that maps to it, or the only one."""
    found = [name for name in names if camera_id_of(name) == camera_id]
    if camera_id in names or len(found) == 1:
        return camera_id if camera_id in names else found[0]
    if not found and len(names) == 1:
        return names[0]
    listed = ", ".join(found or names)[:200]
    needed = f"one camera that maps to {camera_id} is needed (MQTT_CAMERAS maps names)"
    raise refused("/cameras", f"{needed}, got {len(found or names)}: {listed}")


def _camera(document: FrigateText) -> tuple[yaml.Node | None, str]:
    if document.camera is None:
        return document.yaml.root, ""
    cameras = value_of(document.yaml.root, "cameras")
    return value_of(cameras, document.camera), f"/cameras/{document.camera}"


def _zones(document: FrigateText) -> tuple[yaml.MappingNode, str]:
    camera, pointer = _camera(document)
    zones = value_of(camera, "zones")
    if not isinstance(zones, yaml.MappingNode):
        raise refused(pointer, "Frigate's zones are needed, a mapping of names")
    return zones, f"{pointer}/zones"


def _check_own(document: FrigateText) -> None:
    """Refuse zones that share their text with another part of the document."""
    camera, _ = _camera(document)
    zones, pointer = _zones(document)
    shared = "an anchor, alias or merge here would change other parts too; write the zones out"
    if camera is None or not is_within(zones, camera) or has_anchor(document.yaml.text, zones):
        raise refused(pointer, shared)
    for key, zone in zones.value:
        if not isinstance(key, yaml.ScalarNode) or not isinstance(zone, yaml.MappingNode):
            raise refused(pointer, "a name and a mapping with coordinates are needed for each zone")
        given = value_of(zone, "coordinates")
        if not is_within(zone, zones) or (given is not None and not is_within(given, zone)):
            raise refused(f"{pointer}/{key.value}", shared)


def _detect_size(document: FrigateText) -> tuple[int, int] | None:
    """The size of the stream in which Frigate detects; None if the configuration has none."""
    camera, _ = _camera(document)
    for part in (camera, document.yaml.root):
        detect = value_of(part, "detect")
        sides = [value_of(detect, name) for name in ("width", "height")]
        texts = [str(side.value) for side in sides if isinstance(side, yaml.ScalarNode)]
        if len(texts) == 2 and all(text.isascii() and text.isdigit() for text in texts):
            width, height = int(texts[0][:9]), int(texts[1][:9])
            return (width, height) if width and height else None
    return None


def _corners(
    given: yaml.Node, pointer: str, size: tuple[int, int] | None
) -> tuple[list[Corner], tuple[int, int] | None]:
    """Corners in shares, and the size in pixels if they came in pixels."""
    items = given.value if isinstance(given, yaml.SequenceNode) else [given]
    text = ",".join(str(item.value) for item in items if isinstance(item, yaml.ScalarNode))
    try:
        numbers = [float(number) for number in text.split(",")]
    except ValueError as error:
        raise refused(pointer, f"x,y,x,y is needed, got {text!r:.40}") from error
    if len(numbers) % 2 or not all(number >= 0 for number in numbers):
        raise refused(pointer, f"pairs of numbers of at least 0 are needed, got {text!r:.40}")
    scale = (1, 1)
    if max(numbers) > 1:
        if size is None:
            needed = "coordinates above 1 are pixels, which need detect: {width, height}"
            raise refused(pointer, f"{needed} beside the zones, got {text!r:.40}")
        scale = size
    corners = [(x / scale[0], y / scale[1]) for x, y in zip(*[iter(numbers)] * 2, strict=True)]
    if max(map(max, corners)) > 1:
        needed = f"pixels within the {scale[0]} x {scale[1]} of detect are needed"
        raise refused(pointer, f"{needed}, got {text!r:.40}")
    return corners, None if scale == (1, 1) else scale


def _put(
    text: YamlText, given: Any, scale: tuple[int, int] | None
) -> Callable[[Sequence[Corner]], None]:
    def shown(share: float, side: int) -> str:
        return str(round(share, _DIGITS) if scale is None else round(share * scale[side]))

    def put(corners: Sequence[Corner]) -> None:
        pairs = [(shown(x, 0), shown(y, 1)) for x, y in corners]
        if isinstance(given, yaml.ScalarNode):
            text.replace_scalar(given, ",".join(map(",".join, pairs)))
        elif all("," in str(item.value) for item in given.value):
            text.replace_items(given, [",".join(pair) for pair in pairs])
        else:
            text.replace_items(given, [number for pair in pairs for number in pair])

    return put


def _drop(text: YamlText, zones: yaml.MappingNode, key: yaml.Node) -> Callable[[], None]:
    return lambda: text.remove(zones, key)
