"""One track of a JSON body: what its forms say, and which number of it is wrong."""

import math
from collections.abc import Iterable
from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np

from models.geometry.rotation import Array
from service.formats.json_body import UnreadableTrack
from service.formats.scaling import FIELDS as SIZE_FIELDS
from service.formats.track import (
    FOOT_COLUMNS,
    Clock,
    IncomingTrack,
    Limits,
    TrackSkippedError,
    check_heads,
    check_track,
    track_name,
)
from surefoot.people import skip_reason
from surefoot.track_rules import MAX_POINTS, TrackRejectedError, refuse

LARGEST = 2**53  # up to which floats tell whole numbers apart
_LIST = (list, tuple)  # a row; of large bodies, tuples
# How many numbers a row has: of a point three, or five with its head.
_FORMS = {"points": (3, 5), "boxes": (5,), "frames": (3, 5), "frame_boxes": (5,)}
TRACK_FIELDS = frozenset((*_FORMS, *SIZE_FIELDS, "id", "class", "confidence"))


def read_track(raw: Any, source: str, clock: Clock, limits: Limits) -> IncomingTrack:
    """Return the track of `{"id", "points" | "boxes" | "frames" | "frame_boxes", "class"?}`.

    `size` and `normalised` of a track override those of its body. `confidence` 0 marks a track to
    be ignored.

    Raises:
        TrackRejectedError: with a code, the field, the limit and the value received.
        TrackSkippedError: the track is not a person, or is marked to be ignored.
    """
    if isinstance(raw, UnreadableTrack):
        raise TrackRejectedError(raw.code, raw.detail)
    if not isinstance(raw, dict):
        refuse(f"a track is an object, got {type(raw).__name__}")
    _check_person(raw, limits)
    given = [name for name in _FORMS if name in raw]
    if len(given) != 1:
        refuse(
            f"one of points, boxes, frames, frame_boxes is needed, got {given or 'none'}",
        )
    form = given[0]
    try:
        limits = limits.of_size(raw.get("size"), raw.get("normalised"))
    except ValueError as error:
        refuse(str(error))
    rows = limits.in_picture(_numbers(form, raw[form], _FORMS[form]))
    if form.startswith("frame"):
        if clock.frame_rate_hz is None or clock.started_at_s is None:
            raise TrackRejectedError(
                "no_clock", f"{form}: frame_rate_hz and started_at are needed beside it"
            )
        rows[:, 0] = clock.started_at_s + rows[:, 0] / clock.frame_rate_hz
    name = track_name(raw.get("id"))
    if form.endswith("boxes") or rows.shape[1] == FOOT_COLUMNS:
        return check_track(name, source, rows, limits)
    heads = rows[:, FOOT_COLUMNS:]
    check_heads(rows, (limits.width, limits.height))
    return replace(check_track(name, source, rows[:, :FOOT_COLUMNS], limits), heads=heads)


def _check_person(raw: dict[str, Any], limits: Limits) -> None:
    """Check that a track is a pedestrian, and to be used.

    Raises:
        TrackSkippedError: it is not.
        TrackRejectedError: the class is neither text nor a number.
    """
    label = raw.get("class")
    try:
        reason = skip_reason(label, raw.get("confidence"), limits.classes)
    except ValueError as error:
        refuse(f"class: {error}")
    if reason is not None:
        raise TrackSkippedError(reason, label)


def _numbers(form: str, value: Any, taken: tuple[int, ...]) -> Array:
    if not isinstance(value, list):
        refuse(f"{form}: a list is needed, got {value!r:.60}")
    if len(value) > MAX_POINTS:
        raise TrackRejectedError(
            "too_many_points", f"{form}: at most {MAX_POINTS} a track are taken, got {len(value)}"
        )
    if (plain := plain_rows(value, taken)) is not None:
        return plain
    columns = taken[0]
    if value and isinstance(value[0], _LIST) and len(value[0]) in taken:
        columns = len(value[0])
    odd = np.fromiter(_lengths(value), dtype=np.int64, count=len(value)) != columns
    if odd.any():
        at = int(np.argmax(odd))
        row = value[at]
        needed = str(columns) if at else " or ".join(map(str, taken))
        if isinstance(row, _LIST) and len(row) in taken:
            needed += ", as in the first point: all points carry a head or none,"
        refuse(f"{form}/{at}: {needed} numbers are needed, got {row!r:.80}")
    for index, number in enumerate(chain.from_iterable(value)):
        if type(number) is float and -LARGEST < number < LARGEST:
            continue
        at = index // columns
        if isinstance(number, bool) or not isinstance(number, int | float):
            # JSON has no NaN; some writers put null or a word in its place.
            code = "not_finite" if number is None else "malformed"
            raise TrackRejectedError(code, f"{form}/{at}: numbers are needed, got {number!r:.40}")
        if isinstance(number, int) and abs(number) > LARGEST or math.isinf(number):
            raise TrackRejectedError(
                "not_finite", f"{form}/{at}: finite numbers are needed, got {number!r:.40}"
            )
    return np.array(value, dtype=np.float64).reshape(-1, columns)


def _lengths(rows: list[Any]) -> Iterable[int]:
    """The lengths of rows, -1 of one that is none."""
    if set(map(type, rows)) <= set(_LIST):
        return map(len, rows)
    return (len(row) if isinstance(row, _LIST) else -1 for row in rows)


def plain_rows(value: list[Any], lengths: tuple[int, ...]) -> Array | None:
    """The array (N, columns) of a list that is right in every way; None of any other.

    All its rows are lists of one of the lengths, of numbers within `LARGEST`. Who says what is
    wrong looks at one number after another.
    """
    if not set(map(type, value)) <= set(_LIST) or len(found := set(map(len, value))) != 1:
        return None
    numbers = list(chain.from_iterable(value))
    if not found <= set(lengths) or not set(map(type, numbers)) <= {int, float}:
        return None
    try:
        rows = np.array(numbers, dtype=np.float64)
    except OverflowError:  # a whole number that no float holds
        return None
    # One more than the largest may have been rounded to it; NaN is below nothing.
    return rows.reshape(len(value), -1) if np.abs(rows).max() < LARGEST else None
