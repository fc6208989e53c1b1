"""Axis scene metadata: frames and finished tracks, in the released format and the beta before it.

`axis.scene.frame_v1` and `axis.scene.object_track_v1` came with AXIS OS 12.8. Older devices publish
`com.axis.analytics_scene_description.v0.beta` and `com.axis.consolidated_track.v1.beta`.
Boxes are shares of the image.
"""

from array import array
from collections.abc import Mapping
from typing import Any, TypeAlias

from surefoot.bridge.values import (
    NORMALISED,
    Box,
    Detection,
    Ended,
    MessageError,
    SkippedRow,
    WholeTrack,
    box_of,
    each_row,
    listed,
    moment,
    number,
    parsed_json,
    table,
    text,
)

_Found: TypeAlias = Detection | Ended | WholeTrack | SkippedRow

_EDGES = ("left", "top", "right", "bottom")
_FIRST = 1  # the beta formats do not name the channel: a topic has one channel's messages
# The id that an event ends, by the event's type.
_EVENTS = {"TrackEnded": "object_track_id", "Rename": "from_id"}
_OPERATIONS = {"DeleteOperation": "id", "RenameOperation": "from"}


def read_message(message: bytes, cameras: Mapping[int, str]) -> list[_Found]:
    """Read a frame or a finished track, in any of the four formats.

    `cameras` maps the device's channels to camera ids; messages of other channels are empty.
    Objects that only a radar has detected have no box and are omitted.

    Raises:
        MessageError: the message has none of the formats.
    """
    found = table(parsed_json(message), "message")
    if isinstance(found.get("data"), dict):  # as the Message Broker wraps it
        found = found["data"]
    if "frame" in found:
        return _beta_frame(table(found["frame"], "frame"), cameras.get(_FIRST))
    if "detections" in found or "track_events" in found:
        return _frame(found, _camera(found, cameras, "axis.scene.frame_v1"))
    if "path" in found:
        return _track(found, "path", _camera(found, cameras, "axis.scene.object_track_v1"))
    if "observations" in found:
        return _track(found, "observations", cameras.get(_FIRST))
    needed = "`detections`, `frame`, `path` or `observations` is needed"
    got = ", ".join(sorted(map(str, found)))
    raise MessageError("malformed", f"Axis scene metadata: {needed}, got the fields {got:.120}")


def _camera(found: dict[str, Any], cameras: Mapping[int, str], topic: str) -> str | None:
    return cameras.get(int(number(found.get("channel_id"), f"channel_id of {topic}")))


def _frame(frame: dict[str, Any], camera: str | None) -> list[_Found]:
    if camera is None:
        return []
    time_s = moment(frame.get("timestamp"), "timestamp")

    def detection(row: Any, where: str) -> Detection | None:
        return _detection(row, where, camera, "object_track_id", time_s)

    return [
        *each_row(frame.get("detections"), "detections", detection),
        *_ends(frame.get("track_events"), "track_events", camera, _EVENTS),
    ]


def _beta_frame(frame: dict[str, Any], camera: str | None) -> list[_Found]:
    if camera is None:
        return []
    time_s = moment(frame.get("timestamp"), "frame/timestamp")

    def detection(row: Any, where: str) -> Detection | None:
        own = table(row, where).get("timestamp")
        at_s = time_s if own is None else moment(own, f"{where}/timestamp")
        return _detection(row, where, camera, "track_id", at_s)

    return [
        *each_row(frame.get("observations"), "frame/observations", detection),
        *_ends(frame.get("operations"), "frame/operations", camera, _OPERATIONS),
    ]


def _detection(row: Any, where: str, camera: str, id_field: str, time_s: float) -> Detection | None:
    seen = table(row, where)
    if seen.get("bounding_box") is None:
        return None
    box = _box(seen["bounding_box"], f"{where}/bounding_box")
    kind = seen.get("class")
    label = None if kind is None else table(kind, f"{where}/class").get("type")
    return Detection(
        camera=camera,
        time_s=time_s,
        track_id=text(seen.get(id_field), f"{where}/{id_field}"),
        label=None if label is None else text(label, f"{where}/class/type"),
        box=box,
        size=NORMALISED,
    )


def _ends(
    events: Any, what: str, camera: str, id_fields: Mapping[str, str]
) -> list[Ended | SkippedRow]:
    def ended(row: Any, where: str) -> Ended | None:
        event = table(row, where)
        id_field = id_fields.get(str(event.get("type")))
        if id_field is None:
            return None
        return Ended(camera, text(event.get(id_field), f"{where}/{id_field}"))

    return list(each_row(events, what, ended))


def _track(track: dict[str, Any], rows_field: str, camera: str | None) -> list[_Found]:
    if camera is None:
        return []
    track_id = text(track.get("id"), "id")

    def point(row: Any, where: str) -> tuple[float, Box] | None:
        seen = table(row, where)
        if seen.get("bounding_box") is None:
            return None
        box = _box(seen["bounding_box"], f"{where}/bounding_box")
        return moment(seen.get("timestamp"), f"{where}/timestamp"), box

    found: list[_Found] = []
    boxes: dict[float, Box] = {}
    for each in each_row(track.get(rows_field), rows_field, point):
        if isinstance(each, SkippedRow):
            found.append(each)
        else:
            boxes[each[0]] = each[1]
    rows = array("d")
    for time_s, box in sorted(boxes.items()):
        rows.extend((time_s, *box))
    if rows:
        label = _likeliest(track.get("classes"))
        found.append(WholeTrack(camera, track_id, label, "boxes", rows, NORMALISED))
    return found


def _likeliest(classes: Any) -> str | None:
    """The class with the highest score; the classes of a track may be of several objects."""
    scored = [
        (number(kind.get("score", 0), f"classes/{at}/score"), kind.get("type"))
        for at, kind in enumerate(table(each, "classes") for each in listed(classes, "classes"))
    ]
    if not scored:
        return None
    return text(max(scored, key=lambda each: each[0])[1], "classes/type")


def _box(value: Any, where: str) -> Box:
    edges = table(value, where)
    return box_of([number(edges.get(name), f"{where}/{name}") for name in _EDGES], where)
