"""DeepStream's minimal JSON (`msg-conv-payload-type=1`): objects in pixels of the muxer."""

from collections.abc import Callable

from surefoot.bridge.values import (
    Detection,
    MessageError,
    listed,
    moment,
    number,
    parsed_json,
    table,
    text,
)

_UNTRACKED = {"-1", str(2**64 - 1)}  # ids without a tracker in the pipeline
_CELLS = 6  # id, x1, y1, x2, y2, label; attributes after them


def read_frame(
    message: bytes, camera_of: Callable[[str], str | None], size: tuple[float, float]
) -> list[Detection]:
    """The tracked objects of a frame.

    Its time is when the message was made, and unless told otherwise (`msg-conv-frame-interval`) it
    is of every 30th frame: too few for most people.

    `camera_of` has our name of a sensor; frames of those without one are empty. No message says the
    `size` (width, height) of the muxer.

    Raises:
        MessageError: it is no such message.
    """
    frame = table(parsed_json(message), "frame")
    camera = camera_of(text(frame.get("sensorId"), "sensorId"))
    if camera is None:
        return []
    time_s = moment(frame.get("@timestamp"), "@timestamp")
    found = []
    for at, each in enumerate(listed(frame.get("objects"), "objects")):
        where = f"objects/{at}"
        cells = each.split("|", _CELLS) if isinstance(each, str) else []
        if len(cells) < _CELLS:
            needed = "id|x1|y1|x2|y2|label is needed"
            raise MessageError("malformed", f"{where}: {needed}, got {each!r:.80}")
        if cells[0] in _UNTRACKED:
            continue
        left, top, right, bottom = (number(cell, where) for cell in cells[1:5])
        track_id, label = text(cells[0], where), text(cells[5], where)
        box = (left, top, right, bottom)
        found.append(Detection(camera, time_s, track_id, label, box, size))
    return found
