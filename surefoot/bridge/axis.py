"""Axis' `axis.scene.frame_v1` (AXIS OS 12.8 and later): what a camera sees in a frame."""

from collections.abc import Mapping

from surefoot.bridge.values import (
    NORMALISED,
    Detection,
    Ended,
    listed,
    moment,
    number,
    parsed_json,
    table,
    text,
)

_EDGES = ("left", "top", "right", "bottom")
_ENDS = {"TrackEnded": "object_track_id", "Rename": "from_id"}  # by the event's type: whose end


def read_frame(message: bytes, cameras: Mapping[int, str]) -> list[Detection | Ended]:
    """The detections of a frame, boxes as shares of the picture, and the tracks that ended in it.

    `cameras` maps the device's channels to ours; frames of others are empty. What a radar alone
    has seen has no box and is left out.

    Raises:
        MessageError: it is no such frame.
    """
    frame = table(parsed_json(message), "frame")
    camera = cameras.get(int(number(frame.get("channel_id"), "channel_id")))
    if camera is None:
        return []
    time_s = moment(frame.get("timestamp"), "timestamp")
    found: list[Detection | Ended] = []
    for at, each in enumerate(listed(frame.get("detections"), "detections")):
        where = f"detections/{at}"
        seen = table(each, where)
        if seen.get("bounding_box") is None:
            continue
        edges = table(seen["bounding_box"], f"{where}/bounding_box")
        left, top, right, bottom = (
            number(edges.get(name), f"{where}/bounding_box/{name}") for name in _EDGES
        )
        kind = seen.get("class")
        label = None if kind is None else table(kind, f"{where}/class").get("type")
        found.append(
            Detection(
                camera=camera,
                time_s=time_s,
                track_id=text(seen.get("object_track_id"), f"{where}/object_track_id"),
                label=None if label is None else text(label, f"{where}/class/type"),
                box=(left, top, right, bottom),
                size=NORMALISED,
            )
        )
    for at, each in enumerate(listed(frame.get("track_events"), "track_events")):
        event = table(each, f"track_events/{at}")
        whose = _ENDS.get(str(event.get("type")))
        if whose is not None:
            found.append(Ended(camera, text(event.get(whose), f"track_events/{at}/{whose}")))
    return found
