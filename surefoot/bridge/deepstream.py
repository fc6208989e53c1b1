"""DeepStream's JSON, minimal (`msg-conv-payload-type=1`) and full (0): pixels of the muxer."""

from collections.abc import Callable
from typing import Any, TypeAlias

from surefoot.bridge.values import (
    Detection,
    MessageError,
    SkippedRow,
    box_of,
    each_row,
    moment,
    number,
    parsed_json,
    table,
    text,
)

_Size: TypeAlias = tuple[float, float]
_UNTRACKED = {"-1", str(2**64 - 1)}  # ids without a tracker in the pipeline
_CELLS = 6  # id, x1, y1, x2, y2, label; attributes after them
_EDGES = ("topleftx", "toplefty", "bottomrightx", "bottomrighty")
# What the full schema's object has beside the one field that is named after its class.
_NOT_A_CLASS = frozenset(
    {"id", "speed", "direction", "orientation", "bbox", "location", "coordinate", "signature"}
    | {"maskoutline", "pose", "embedding", "bbox3d", "segmentation", "tracking", "detection"}
)


def read_message(
    message: bytes, camera_of: Callable[[str], str | None], size: _Size
) -> list[Detection | SkippedRow]:
    """The tracked objects of a frame (minimal schema), or one of them (full schema).

    The time is that of the message. By default DeepStream sends every 30th frame
    (`msg-conv-frame-interval`), which is too few for most people.

    `camera_of` returns the camera id of a sensor, or None to ignore it. `size` is (width, height)
    of the muxer, which no message states.

    Raises:
        MessageError: the message has neither schema.
    """
    found = table(parsed_json(message), "message")
    if "object" in found:
        sensor = table(found.get("sensor"), "sensor")
        camera = camera_of(text(sensor.get("id"), "sensor/id"))
        seen = None if camera is None else _object(found, camera, size)
        return [] if seen is None else [seen]
    camera = camera_of(text(found.get("sensorId"), "sensorId"))
    if camera is None:
        return []
    time_s = moment(found.get("@timestamp"), "@timestamp")

    def detection(row: Any, where: str) -> Detection | None:
        cells = row.split("|", _CELLS) if isinstance(row, str) else []
        if len(cells) < _CELLS:
            needed = "id|x1|y1|x2|y2|label is needed"
            raise MessageError("malformed", f"{where}: {needed}, got {row!r:.80}")
        if cells[0] in _UNTRACKED:
            return None
        box = box_of([number(cell, where) for cell in cells[1:5]], where)
        track_id, label = text(cells[0], where), text(cells[5], where)
        return Detection(camera, time_s, track_id, label, box, size)

    return list(each_row(found.get("objects"), "objects", detection))


def _object(found: dict[str, Any], camera: str, size: _Size) -> Detection | None:
    seen = table(found["object"], "object")
    track_id = text(seen.get("id"), "object/id")
    if track_id in _UNTRACKED:
        return None
    edges = table(seen.get("bbox"), "object/bbox")
    places = [number(edges.get(name), f"object/bbox/{name}") for name in _EDGES]
    box = box_of(places, "object/bbox")
    # The class is the name of the field that holds its attributes, `"person": {"age": ...}`;
    # DeepStream writes it before all other objects.
    kinds = [name for name, value in seen.items() if _is_class(name, value)]
    label = text(kinds[0], "object") if kinds else None
    time_s = moment(found.get("@timestamp"), "@timestamp")
    return Detection(camera, time_s, track_id, label, box, size)


def _is_class(name: str, value: Any) -> bool:
    return isinstance(value, dict) and name not in _NOT_A_CLASS
