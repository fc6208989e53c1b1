"""Frigate's people: of `frigate/events` what ends one, and of `/api/events` what it has stored."""

from array import array
from collections.abc import Callable
from typing import TypeAlias

import msgspec

from surefoot.bridge.values import (
    MAX_MESSAGE_BYTES,
    NORMALISED,
    MessageError,
    SkippedRow,
    WholeTrack,
    check_json,
    each_row,
    text,
)
from surefoot.people import PEDESTRIANS

PERSON = "person"
CameraOf: TypeAlias = Callable[[str], str]  # our name of a camera of Frigate's
_Point: TypeAlias = tuple[tuple[float, float], float]
MAX_ANSWER_BYTES = 64 * MAX_MESSAGE_BYTES
# Feet as low as this are cut off by the picture's edge: they are no feet.
_LOWEST = 0.99


class _After(msgspec.Struct):
    id: str
    camera: str
    label: str
    false_positive: bool = False
    path_data: list[_Point] | None = None


class _Event(msgspec.Struct):
    type: str
    after: _After


class Stored(msgspec.Struct):
    """An event of Frigate's database, its path not read yet; `end_time` is None while it lasts."""

    id: str
    camera: str
    label: str
    start_time: float
    end_time: float | None = None
    false_positive: bool | None = None
    data: msgspec.Raw = msgspec.Raw(b"null")


class _Data(msgspec.Struct):
    path_data: list[_Point] | None = None


_read = msgspec.json.Decoder(_Event).decode
_read_rows = msgspec.json.Decoder(list[msgspec.Raw]).decode
_read_stored = msgspec.json.Decoder(Stored).decode
_read_data = msgspec.json.Decoder(_Data | None).decode


def read_event(message: bytes, camera_of: CameraOf) -> WholeTrack | None:
    """Return the path of a person whose event has ended; None for other messages and no path.

    Points are `[time_s, x, y]`, the bottom centre as a share of the picture.

    Raises:
        MessageError: it is none of Frigate's, or of one before 0.16.
    """
    check_json(message)
    try:
        event = _read(message)
    except (msgspec.MsgspecError, UnicodeDecodeError) as error:
        raise MessageError("malformed", f"no event of Frigate's: {error}") from error
    after = event.after
    if event.type != "end" or after.false_positive or not PEDESTRIANS.include(after.label):
        return None
    return _track(after, after.path_data, camera_of, "after.")


def read_stored(answer: bytes) -> list[Stored | SkippedRow]:
    """The events of an answer of `/api/events`; one that cannot be read is skipped.

    Raises:
        MessageError: the answer is none of Frigate's.
    """
    check_json(answer, MAX_ANSWER_BYTES)
    try:
        rows = _read_rows(answer)
    except (msgspec.MsgspecError, UnicodeDecodeError) as error:
        raise MessageError("malformed", f"no events of Frigate's: {error}") from error
    return list(each_row(rows, "events", _stored))


def _stored(row: msgspec.Raw, where: str) -> Stored:
    try:
        return _read_stored(row)
    except (msgspec.MsgspecError, UnicodeDecodeError) as error:
        raise MessageError("malformed", f"{where}: {error}") from error


def track_of(event: Stored, camera_of: CameraOf) -> WholeTrack | None:
    """The path of a person of the database, the same as of the message that ended it.

    Raises:
        MessageError: it has none, as what was entered by hand, or is no path.
    """
    if event.end_time is None or event.false_positive or not PEDESTRIANS.include(event.label):
        return None
    check_json(bytes(event.data))
    try:
        data = _read_data(event.data)
    except (msgspec.MsgspecError, UnicodeDecodeError) as error:
        raise MessageError("malformed", f"no event of Frigate's: data: {error}") from error
    return _track(event, None if data is None else data.path_data, camera_of, "data.")


def _track(
    event: _After | Stored, path: list[_Point] | None, camera_of: CameraOf, where: str
) -> WholeTrack | None:
    if path is None:
        told = "Frigate 0.16 or newer tells it, and not of what was entered by hand"
        raise MessageError("malformed", f"{where}path_data: a path is needed; {told}")
    rows = array("d")
    for (x, y), time_s in path:
        if y < _LOWEST:
            rows.extend((time_s, x, y))
    if not rows:
        return None
    camera = camera_of(event.camera)
    return WholeTrack(camera, text(event.id, "id"), event.label, "points", rows, NORMALISED)
