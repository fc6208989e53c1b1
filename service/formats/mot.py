"""Tracks as MOTChallenge text, and as the trackers write it that took their form from there."""

import re
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from service.errors import MalformedError, TooLargeError
from service.formats.batch import check_count, collect, malformed
from service.formats.track import (
    COCO_PEOPLE,
    MAX_ID_LENGTH,
    Batch,
    Clock,
    IncomingTrack,
    Limits,
    check_track,
    refuse,
    track_name,
)

MAX_LINES = 500_000  # some seconds of reading
_LEAST_CELLS = 6  # frame, id, left, top, width, height
_CONF, _CLASS, _VISIBILITY = 6, 7, 8
_WITH_CLASS = (8, 9)  # lines of ten have a place in the world there
_NONE_GIVEN = -1.0
# Of ground truth, which has a visibility in column 9: pedestrians and people who stand.
_TRUTH_PEOPLE = frozenset((1.0, 7.0))
_MOST_NAMED = 12  # class numbers in a message


@dataclass(slots=True)
class _Lines:
    """Lines of a text: numbers of lines by track, lines that cannot be read by track."""

    rows: dict[str, list[list[float]]] = field(default_factory=dict)
    broken: dict[str, str] = field(default_factory=dict)


def read_mot(
    body: bytes,
    source: str,
    clock: Clock,
    limits: Limits,
    classes: frozenset[int] | None = None,
) -> Batch:
    """The tracks of MOTChallenge text: `frame,id,left,top,width,height,conf,...` a line.

    Frames and pixels count from 1 there: a frame's time is `started_at + (frame - 1) /
    frame_rate_hz`. Lines of 8 and 9 columns have a class in the eighth, -1 for none. Who is a
    person: in ground truth (column 9 is a visibility, 0 to 1) classes 1 and 7, else class 0, as
    detectors number them; with `classes`, those, however many columns there are. Lines of other
    classes, and lines with conf 0, which that format marks "ignore", are left out and counted. A
    line that cannot be read costs its own track and no other; a rejection's index is the place of
    its track by first appearance.

    Raises:
        MalformedError: the rate or the start is missing, no line at all can be read, or none of a
            person.
        TooLargeError: too many lines or tracks.
    """
    if clock.frame_rate_hz is None or clock.started_at_s is None:
        raise malformed("query: frame_rate_hz and started_at are needed with text/csv")
    lines = _read_lines(body)
    if lines.broken and not any(lines.rows[name] for name in lines.rows):
        raise malformed(f"not MOTChallenge text: {next(iter(lines.broken.values()))}")
    every = [row for rows in lines.rows.values() for row in rows]
    people = _people(every, classes)
    boxes: dict[str, list[list[float]]] = {}
    for name, rows in lines.rows.items():
        kept = [row for row in rows if _counts(row, people, given=classes is not None)]
        if kept or name in lines.broken:
            boxes[name] = [_box(row, clock) for row in kept]
    check_count(len(boxes))
    left_out = len(every) - sum(len(rows) for rows in boxes.values())
    if every and not boxes:
        raise _nobody(every, people, given=classes is not None)

    def read(track_id: str) -> IncomingTrack:
        if track_id in lines.broken:
            refuse(lines.broken[track_id])
        array = np.array(boxes[track_id], dtype=np.float64).reshape(-1, 5)
        ordered = array[np.argsort(array[:, 0], kind="stable")]
        return check_track(track_name(track_id), source, ordered, limits)

    return collect(
        (
            (index, {"id": track_id}, partial(read, track_id))
            for index, track_id in enumerate(boxes)
        ),
        left_out,
    )


def read_classes(text: str) -> frozenset[int]:
    """The class numbers of people in a query, with commas between them.

    Raises:
        MalformedError: no such list.
    """
    if not re.fullmatch(r"\d{1,6}(,\d{1,6}){0,99}", text, re.ASCII):
        reason = f"whole numbers with commas are needed, such as 0 or 1,7, got {text!r:.60}"
        raise MalformedError.of_field("classes", reason)
    return frozenset(int(number) for number in text.split(","))


def _read_lines(body: bytes) -> _Lines:
    lines = _Lines()
    count = body.count(b"\n")
    if count > MAX_LINES:
        raise TooLargeError(
            f"lines: at most {MAX_LINES} a request are taken, got {count}; "
            "post a part of the time at once"
        )
    text = body.decode("utf-8", errors="replace")
    for line_no, line in enumerate(text.splitlines(), start=1):
        if not line.strip() or (line_no == 1 and line.lower().startswith("frame")):
            continue
        cells = [cell.strip() for cell in line.split(",")]
        name = cells[1][:MAX_ID_LENGTH] if len(cells) > 1 and cells[1] else f"line {line_no}"
        rows = lines.rows.setdefault(name, [])
        try:
            numbers = [float(cell) for number, cell in enumerate(cells) if number != 1]
        except ValueError as error:
            lines.broken.setdefault(name, f"line {line_no}: {error}; got {line[:80]!r}")
            continue
        if len(cells) < _LEAST_CELLS:
            few = f"at least {_LEAST_CELLS} columns are needed, got {line[:80]!r}"
            lines.broken.setdefault(name, f"line {line_no}: {few}")
            continue
        rows.append([numbers[0], float(line_no), *numbers[1:]])
    return lines


def _people(rows: list[list[float]], classes: frozenset[int] | None) -> frozenset[float]:
    if classes is not None:
        return frozenset(float(number) for number in classes)
    truth = any(len(row) == max(_WITH_CLASS) and 0 <= row[_VISIBILITY] <= 1 for row in rows)
    return _TRUTH_PEOPLE if truth else COCO_PEOPLE


def _class_of(row: list[float], *, given: bool) -> float:
    has = len(row) > _CLASS if given else len(row) in _WITH_CLASS
    return row[_CLASS] if has else _NONE_GIVEN


def _counts(row: list[float], people: frozenset[float], *, given: bool) -> bool:
    """True of a line of a person that is not to be ignored."""
    if len(row) > _CONF and row[_CONF] == 0:
        return False
    number = _class_of(row, given=given)
    return number == _NONE_GIVEN or number in people


def _box(row: list[float], clock: Clock) -> list[float]:
    """Time and box, counted from 0."""
    assert clock.frame_rate_hz is not None
    assert clock.started_at_s is not None
    frame, _, left, top, width, height = row[:_LEAST_CELLS]
    time_s = clock.started_at_s + (frame - 1) / clock.frame_rate_hz
    return [time_s, left - 1, top - 1, left - 1 + width, top - 1 + height]


def _nobody(rows: list[list[float]], people: frozenset[float], *, given: bool) -> MalformedError:
    found = sorted({_class_of(row, given=given) for row in rows})
    seen = ", ".join(f"{number:g}" for number in found[:_MOST_NAMED])
    seen += ", ..." if len(found) > _MOST_NAMED else ""
    wanted = ", ".join(f"{number:g}" for number in sorted(people))
    reason = (
        f"no line is of a person: classes {wanted} are taken for people, got {len(rows)} lines of "
        f"classes {seen}; say with classes= which numbers are people; lines with conf 0 are ignored"
    )
    return MalformedError.of_field("classes", reason)
