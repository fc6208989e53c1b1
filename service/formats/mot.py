"""Tracks as MOTChallenge text, and as the trackers write it that took their form from there."""

import re
from array import array
from dataclasses import dataclass, field, replace
from functools import partial
from io import BytesIO, TextIOWrapper
from itertools import islice, repeat

import numpy as np

from models.effort import check_effort
from models.geometry.rotation import Array, Index
from service.errors import MalformedError, TooLargeError
from service.formats.batch import check_count, collect, malformed, reading
from service.formats.track import (
    COCO_PEOPLE,
    MAX_ID_LENGTH,
    MAX_TRACKS,
    Batch,
    Clock,
    IncomingTrack,
    Limits,
    check_track,
    refuse,
    track_name,
)

MAX_LINES = 500_000  # some seconds of reading
_BLOCK = 1_000  # lines that are read at once
MAX_LINE_CHARS = 1_000  # ten numbers need 200
_MOST_IDS = 4 * MAX_TRACKS  # those of cars among them
_TRIED = 10_000  # lines: a broken track's are read on, while none of a text could be
_LEAST_CELLS = 6  # frame, id, left, top, width, height
_FEW = f"at least {_LEAST_CELLS} columns and at most {MAX_LINE_CHARS} characters are needed"
# Columns of a line's numbers, which have no id among them; a line may end before the last.
_CONF, _CLASS, _VISIBILITY = 5, 6, 7
_READ_CELLS = 9  # up to the visibility
_NONE = array("d", [float("nan")] * (_VISIBILITY + 1))
_WITH_CLASS = (8, 9)  # cells of lines that have one; lines of ten have a place in the world there
_NONE_GIVEN = -1.0
# Of ground truth, which has a visibility in column 9: pedestrians and people who stand.
_TRUTH_PEOPLE = frozenset((1.0, 7.0))
_MOST_NAMED = 12  # class numbers in a message


@dataclass(slots=True)
class _Lines:
    """Lines of a text as they are read: of a line its track, its numbers and how many cells it had.

    Floats of Python's in lists would be ten times as large.
    """

    names: dict[str, int] = field(default_factory=dict)  # of tracks, in the order of their coming
    broken: dict[str, str] = field(default_factory=dict)  # tracks with a line that cannot be read
    tracks: "array[int]" = field(default_factory=lambda: array("q"))
    cells: "array[int]" = field(default_factory=lambda: array("q"))
    numbers: "array[float]" = field(default_factory=lambda: array("d"))


def read_mot(
    body: bytes,
    source: str,
    clock: Clock,
    limits: Limits,
    classes: frozenset[int] | None = None,
) -> Batch:
    """The tracks of MOTChallenge text: `frame,id,left,top,width,height,conf,...` a line.

    Frames and pixels count from 1 there, shares of a picture from 0: a frame's time is
    `started_at + (frame - 1) / frame_rate_hz`. Lines of 8 and 9 columns have a class in
    the eighth, -1 for none. Who is a person: in ground truth (column 9 is a visibility, 0 to 1)
    classes 1 and 7, else class 0, as detectors number them; with `classes`, those, however many
    columns there are. Lines of other classes, and lines with conf 0, which that format marks
    "ignore", are left out and counted. A line that cannot be read costs its own track and no other;
    a rejection's index is the place of its track by first appearance.

    Raises:
        MalformedError: the rate or the start is missing, no line at all can be read, or none of a
            person.
        TooLargeError: too many lines or tracks.
    """
    if clock.frame_rate_hz is None or clock.started_at_s is None:
        raise malformed("query: frame_rate_hz and started_at are needed with text/csv")
    with reading():
        lines = _read_lines(body)
    if lines.broken and not lines.tracks:
        raise malformed(f"not MOTChallenge text: {next(iter(lines.broken.values()))}")
    numbers = np.frombuffer(lines.numbers).reshape(-1, len(_NONE))
    cells = np.frombuffer(lines.cells, dtype=np.int64)
    found = _classes_of(numbers, cells, given=classes is not None)
    people = _people(numbers, cells) if classes is None else classes
    # Who stands with conf 0 is marked "ignore".
    kept = (cells <= _CONF + 1) | (numbers[:, _CONF] != 0)
    kept &= (found == _NONE_GIVEN) | np.isin(found, sorted(people))
    of = np.frombuffer(lines.tracks, dtype=np.int64)
    whole = ~np.isin(of, [lines.names[name] for name in lines.broken])
    left_out = int((whole & ~kept).sum())
    kept &= whole
    limits = replace(limits.of_source(source), first_px=1)
    boxes = _boxes(numbers[kept], clock, first=0 if limits.normalised else limits.first_px)
    of = of[kept]
    ordered = np.lexsort((boxes[:, 0], of))
    boxes = boxes[ordered]
    ends = np.cumsum(np.bincount(of, minlength=len(lines.names))).tolist()
    spans = {
        name: boxes[begin:end]
        for name, begin, end in zip(lines.names, [0, *ends], ends, strict=False)
        if end > begin or name in lines.broken
    }
    check_count(len(spans))
    if lines.tracks and not spans:
        raise _nobody(found, people)

    def read(track_id: str) -> IncomingTrack:
        if track_id in lines.broken:
            refuse(lines.broken[track_id])
        return check_track(track_name(track_id), source, limits.in_picture(spans[track_id]), limits)

    return collect(
        (
            (index, {"id": track_id}, partial(read, track_id))
            for index, track_id in enumerate(spans)
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
    count = body.count(b"\n") + body.count(b"\r") - body.count(b"\r\n")
    if count > MAX_LINES:
        raise TooLargeError(
            f"lines: at most {MAX_LINES} a request are taken, got {count}; "
            "post a part of the time at once"
        )
    lines = _Lines()
    text = TextIOWrapper(BytesIO(body), encoding="utf-8-sig", errors="replace")
    first_no = 1
    while block := list(islice(text, _BLOCK)):
        check_effort()
        if not _read_even(lines, block):
            for line_no, line in enumerate(block, start=first_no):
                if line.isspace() or (line_no == 1 and line[:5].lower() == "frame"):
                    continue
                _read_line(lines, line_no, line)
        first_no += len(block)
        if len(lines.names) > _MOST_IDS:
            raise TooLargeError(f"ids: at most {_MOST_IDS} of all classes are taken, got more")
        if len(lines.broken) > MAX_TRACKS:
            if lines.tracks:
                check_count(len(lines.broken))
            break
    return lines


def _read_even(lines: _Lines, block: list[str]) -> bool:
    """Read a block of lines at once, twice as fast, where all are right and have as many cells.

    False where they are not, and none of them was read.
    """
    commas = set(map(str.count, block, repeat(",")))
    count = min(commas) + 1
    if len(commas) > 1 or count < _LEAST_CELLS or max(map(len, block)) > MAX_LINE_CHARS:
        return False
    names = [line.split(",", 2)[1].strip()[:MAX_ID_LENGTH] for line in block]
    columns = [at for at in range(min(count, _READ_CELLS)) if at != 1]
    numbers = np.full((len(block), len(_NONE)), np.nan)
    try:
        read = np.loadtxt(block, delimiter=",", usecols=columns, comments=None, ndmin=2)
    except ValueError:
        return False
    if len(read) < len(block) or not all(names):
        return False
    numbers[:, : len(columns)] = read
    lines.tracks.extend(lines.names.setdefault(name, len(lines.names)) for name in names)
    lines.cells.extend([count] * len(block))
    lines.numbers.frombytes(numbers.tobytes())
    return True


def _read_line(lines: _Lines, line_no: int, line: str) -> None:
    cells = line.split(",") if len(line) <= MAX_LINE_CHARS else []
    count = len(cells)
    name = cells[1].strip()[:MAX_ID_LENGTH] if count > 1 else ""
    name = name or f"line {line_no}"
    at = lines.names.setdefault(name, len(lines.names))
    if name in lines.broken and (lines.tracks or line_no > _TRIED):
        return
    try:
        if count < _LEAST_CELLS:
            raise ValueError(_FEW)
        del cells[_READ_CELLS:], cells[1]
        numbers = array("d", map(float, cells))
    except ValueError as error:
        got = line[:MAX_LINE_CHARS].strip()[:80]
        lines.broken.setdefault(name, f"line {line_no}: {error}; got {got!r}")
        return
    lines.tracks.append(at)
    lines.cells.append(count)
    lines.numbers += numbers
    lines.numbers += _NONE[len(numbers) :]


def _people(numbers: Array, cells: Index) -> frozenset[float]:
    """Numbers of the classes that are people, where the request does not say."""
    visible = numbers[cells == max(_WITH_CLASS), _VISIBILITY]
    truth = bool(((visible >= 0) & (visible <= 1)).any())
    return _TRUTH_PEOPLE if truth else COCO_PEOPLE


def _classes_of(numbers: Array, cells: Index, *, given: bool) -> Array:
    """The class of each line (N,), `_NONE_GIVEN` where it has none."""
    has = cells > _CLASS + 1 if given else np.isin(cells, _WITH_CLASS)
    return np.where(has, numbers[:, _CLASS], _NONE_GIVEN)


def _boxes(numbers: Array, clock: Clock, *, first: int) -> Array:
    """Times and boxes (N, 5), counted from 0 where pixels were counted from `first`."""
    assert clock.frame_rate_hz is not None
    assert clock.started_at_s is not None
    frame, left, top, width, height = numbers[:, : _LEAST_CELLS - 1].T
    left, top = left - first, top - first
    time_s = clock.started_at_s + (frame - 1) / clock.frame_rate_hz
    return np.column_stack([time_s, left, top, left + width, top + height])


def _nobody(classes: Array, people: frozenset[float]) -> MalformedError:
    found = np.unique(classes).tolist()
    seen = ", ".join(f"{number:g}" for number in found[:_MOST_NAMED])
    seen += ", ..." if len(found) > _MOST_NAMED else ""
    wanted = ", ".join(f"{number:g}" for number in sorted(people))
    reason = (
        f"no line is of a person: classes {wanted} are taken for people, got {len(classes)} lines "
        f"of classes {seen}; say with classes= which numbers are people; lines with conf 0 are "
        "ignored"
    )
    return MalformedError.of_field("classes", reason)
