"""Rows of boxes: supervision's CSVSink and JSONSink, Ultralytics' `save_txt` and `summary()`."""

import csv
from collections.abc import Iterable, Iterator
from io import StringIO
from typing import Any, NamedTuple

import msgspec

from surefoot.bridge.values import (
    NORMALISED,
    Detection,
    MessageError,
    SkippedRow,
    check_json,
    check_size,
    confidence_of,
    each_row,
    number,
    parsed_json,
    table,
    text,
)
from surefoot.people import PEDESTRIANS

MAX_FILE_BYTES = 16 * 1024 * 1024  # 80,000 rows or so; JSON is built as a whole


class Clock(NamedTuple):
    """The time of a row: `started_at_s` and `column` over `rate_hz`; neither sink writes one.

    `column` is one of `custom_data`: a frame, or with a rate of 1 and a start of 0 a time in s.
    """

    column: str
    rate_hz: float = 1.0
    started_at_s: float = 0.0


def read_supervision_csv(
    file: bytes, camera: str, clock: Clock, size: tuple[float, float] | None
) -> Iterator[Detection | SkippedRow]:
    """The tracked boxes of a CSVSink's file, in pixels of a picture of that size.

    Raises:
        MessageError: it is none.
    """
    check_size(file, MAX_FILE_BYTES)
    try:
        rows = csv.DictReader(StringIO(file.decode("utf-8-sig"), newline=""), strict=True)
        yield from _supervision(rows, camera, clock, size)
    except (UnicodeDecodeError, csv.Error) as error:
        raise MessageError("malformed", f"no CSV: {error}") from error


def read_supervision_json(
    file: bytes, camera: str, clock: Clock, size: tuple[float, float] | None
) -> Iterator[Detection | SkippedRow]:
    """The tracked boxes of a JSONSink's file, in pixels of a picture of that size.

    Raises:
        MessageError: it is none.
    """
    check_json(file, MAX_FILE_BYTES)
    try:
        rows = msgspec.json.decode(file, type=list[Any])
    except (msgspec.MsgspecError, UnicodeDecodeError) as error:
        raise MessageError("malformed", f"no list of rows: {error}") from error
    yield from _supervision(rows, camera, clock, size)


def read_ultralytics_text(lines: bytes, camera: str, time_s: float) -> list[Detection | SkippedRow]:
    """The tracked boxes of one frame's `save_txt`: `class xc yc w h [conf] id`, shares.

    Of six columns the last is an id where it is a whole number, else a confidence.

    Raises:
        MessageError: it is none; of a model that segments, lines are outlines.
    """
    check_size(lines)

    def detection(line: str, where: str) -> Detection | None:
        cells = line.split()
        if not cells:
            return None
        if not 5 <= len(cells) <= 7:
            needed = "class xc yc w h [conf] id is needed"
            raise MessageError("malformed", f"{where}: {needed}, got {line!r:.80}")
        kind, x, y, width, height = (number(cell, where) for cell in cells[:5])
        if len(cells) == 5 or not cells[-1].isdecimal():
            return None
        box = (x - width / 2, y - height / 2, x + width / 2, y + height / 2)
        track_id = text(cells[-1], where)
        ignored = confidence_of(cells[5]) if len(cells) == 7 else None
        return Detection(camera, time_s, track_id, _label(kind), box, NORMALISED, ignored)

    rows = lines.decode("utf-8", errors="replace").splitlines()
    return list(each_row(rows, "lines", detection))


def read_ultralytics_summary(
    message: bytes, camera: str, time_s: float, size: tuple[float, float]
) -> list[Detection | SkippedRow]:
    """The tracked boxes of one frame's `results.to_json()`, in pixels of `orig_shape` as a size.

    Raises:
        MessageError: it is none.
    """

    def detection(each: Any, where: str) -> Detection | None:
        row = table(each, where)
        if row.get("track_id") is None:
            return None
        edges = table(row.get("box"), f"{where}/box")
        names = ("x1", "y1", "x2", "y2")
        x1, y1, x2, y2 = (number(edges.get(name), f"{where}/box/{name}") for name in names)
        label, track_id = text(row.get("name"), f"{where}/name"), text(row["track_id"], where)
        ignored, box = confidence_of(row.get("confidence")), (x1, y1, x2, y2)
        return Detection(camera, time_s, track_id, label, box, size, ignored)

    return list(each_row(parsed_json(message), "rows", detection))


def _supervision(
    rows: Iterable[Any],
    camera: str,
    clock: Clock,
    size: tuple[float, float] | None,
) -> Iterator[Detection | SkippedRow]:
    def detection(each: Any, where: str) -> Detection | None:
        row = table(each, where)
        track_id = row.get("tracker_id")
        if track_id is None or track_id in ("", -1, "-1"):
            return None
        when = number(row.get(clock.column), f"{where}/{clock.column}")
        names = ("x_min", "y_min", "x_max", "y_max")
        x1, y1, x2, y2 = (number(row.get(name), f"{where}/{name}") for name in names)
        named, kind = row.get("class_name"), row.get("class_id")
        label = None if kind in (None, "") else _label(number(kind, f"{where}/class_id"))
        return Detection(
            camera=camera,
            time_s=clock.started_at_s + when / clock.rate_hz,
            track_id=text(track_id, f"{where}/tracker_id"),
            label=text(named, f"{where}/class_name") if named else label,
            box=(x1, y1, x2, y2),
            size=size,
            confidence=confidence_of(row.get("confidence")),
        )

    return each_row(rows, "rows", detection)


def _label(kind: float) -> str:
    """Return the name of a class number, as models that were trained on COCO have them."""
    return "person" if PEDESTRIANS.include(kind) else f"class {kind:g}"
