"""The plain topic's frames: `{"time_s", "size" or "normalised", "detections", "ended"}`."""

from typing import Any

from surefoot.bridge.values import (
    NORMALISED,
    Detection,
    Ended,
    MessageError,
    SkippedRow,
    box_of,
    confidence_of,
    each_row,
    label_of,
    number,
    parsed_json,
    seconds,
    table,
    text,
)


def read_frame(message: bytes, camera: str) -> list[Detection | Ended | SkippedRow]:
    """Return the detections `{"id", "box", "class"?, "confidence"?}` of a frame and ended ids.

    A box is [x1, y1, x2, y2] in pixels of `size` [width, height], in shares if `normalised` is
    true, else in pixels of the camera's image. A class is a name or a COCO number.

    Raises:
        MessageError: the message is no frame.
    """
    frame = table(parsed_json(message), "frame")
    time_s = seconds(frame.get("time_s"), "time_s")
    size: tuple[float, float] | None = None
    if frame.get("normalised") is True:
        size = NORMALISED
    elif frame.get("size") is not None:
        width, height = _numbers(frame["size"], 2, "size")
        size = (width, height)

    def detection(row: Any, where: str) -> Detection:
        seen = table(row, where)
        track_id = text(seen.get("id"), f"{where}/id")
        label = label_of(seen.get("class"), f"{where}/class")
        box = box_of(_numbers(seen.get("box"), 4, f"{where}/box"), f"{where}/box")
        ignored = confidence_of(seen.get("confidence"))
        return Detection(camera, time_s, track_id, label, box, size, ignored)

    def ended(row: Any, where: str) -> Ended:
        return Ended(camera, text(row, where))

    return [
        *each_row(frame.get("detections"), "detections", detection),
        *each_row(frame.get("ended"), "ended", ended),
    ]


def _numbers(value: object, count: int, what: str) -> list[float]:
    if not isinstance(value, list) or len(value) != count:
        needed = f"{count} numbers are needed"
        raise MessageError("malformed", f"{what}: {needed}, got {value!r:.40}")
    return [number(each, what) for each in value]
