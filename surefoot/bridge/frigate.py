"""Frigate's `frigate/events`: the whole path of a person, out of the message that ends it."""

from array import array
from collections.abc import Callable
from typing import TypeAlias

import msgspec

from surefoot.bridge.values import NORMALISED, MessageError, WholeTrack, check_size, text

_Point: TypeAlias = tuple[tuple[float, float], float]
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


_read = msgspec.json.Decoder(_Event).decode


def read_event(message: bytes, camera_of: Callable[[str], str]) -> WholeTrack | None:
    """The path of a person whose event has ended; None of any other message, and of no foot.

    Points are `[time_s, x, y]`, the bottom centre as a share of the picture. `camera_of` gives
    our name of a camera of Frigate's.

    Raises:
        MessageError: it is none of Frigate's, or of one before 0.16.
    """
    check_size(message)
    try:
        event = _read(message)
    except (msgspec.MsgspecError, UnicodeDecodeError) as error:
        raise MessageError("malformed", f"no event of Frigate's: {error}") from error
    after = event.after
    if event.type != "end" or after.label != "person" or after.false_positive:
        return None
    if after.path_data is None:
        raise MessageError("malformed", "after.path_data: Frigate 0.16 or newer is needed")
    rows = array("d")
    for (x, y), time_s in after.path_data:
        if y < _LOWEST:
            rows.extend((time_s, x, y))
    if not rows:
        return None
    camera = camera_of(after.camera)
    track_id = text(after.id, "after.id")
    return WholeTrack(camera, track_id, after.label, "points", rows, NORMALISED)
