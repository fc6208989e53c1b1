"""The plain topic's frames: `{"time_s", "size" or "normalised", "detections", "ended"}`."""

from surefoot.bridge.values import (
    NORMALISED,
    Detection,
    Ended,
    MessageError,
    confidence_of,
    label_of,
    listed,
    number,
    parsed_json,
    seconds,
    table,
    text,
)


def read_frame(message: bytes, camera: str) -> list[Detection | Ended]:
    """Return the detections `{"id", "box", "class"?, "confidence"?}` of a frame and ended ids.

    A box is [x1, y1, x2, y2] in pixels of `size` [width, height], in shares if `normalised` is
    true, else in pixels of the camera's image. A class is a name or a COCO number.

    Raises:
        MessageError: it is no such frame.
    """
    frame = table(parsed_json(message), "frame")
    time_s = seconds(frame.get("time_s"), "time_s")
    size: tuple[float, float] | None = None
    if frame.get("normalised") is True:
        size = NORMALISED
    elif frame.get("size") is not None:
        width, height = _numbers(frame["size"], 2, "size")
        size = (width, height)
    found: list[Detection | Ended] = []
    for at, each in enumerate(listed(frame.get("detections"), "detections")):
        where = f"detections/{at}"
        seen = table(each, where)
        track_id = text(seen.get("id"), f"{where}/id")
        label = label_of(seen.get("class"), f"{where}/class")
        x1, y1, x2, y2 = _numbers(seen.get("box"), 4, f"{where}/box")
        ignored = confidence_of(seen.get("confidence"))
        found.append(Detection(camera, time_s, track_id, label, (x1, y1, x2, y2), size, ignored))
    for at, each in enumerate(listed(frame.get("ended"), "ended")):
        found.append(Ended(camera, text(each, f"ended/{at}")))
    return found


def _numbers(value: object, count: int, what: str) -> list[float]:
    if not isinstance(value, list) or len(value) != count:
        needed = f"{count} numbers are needed"
        raise MessageError("malformed", f"{what}: {needed}, got {value!r:.40}")
    return [number(each, what) for each in value]
