"""Lines of a table as arrays: for each line its track and the numbers of its columns."""

from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from io import BytesIO, TextIOWrapper
from itertools import islice, repeat

import numpy as np

from models.effort import check_effort
from models.geometry.rotation import Array, Index
from surefoot.tabular.head import Head, is_missing

MAX_LINE_CHARS = 1_000  # ten numbers need 200
MAX_ID_LENGTH = 200
_BLOCK = 1_000  # lines that are read at once
_TRIED = 10_000  # lines of broken tracks that are read while no line at all was readable


class TooManyError(Exception):
    """A table with more lines or tracks than the caller takes; the message has limit and value."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """The most that is read of one table; None: no limit."""

    lines: int | None = None
    ids: int | None = None
    broken: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """Columns to read: the id's, the numbers', and the class's if it is text.

    A cell of `needed` has to be a number, one of `free` may be anything, and others may be empty.
    """

    id_at: int
    numbers: tuple[int, ...]
    needed: frozenset[int]
    free: frozenset[int] = frozenset()
    text_at: int | None = None


@dataclass(slots=True)
class Lines:
    """Lines as they were read. Lists of Python's floats would need ten times the memory.

    `names` and `labels` number tracks and class names in the order in which they appear;
    `broken` has the reason for each track with a line that cannot be read.
    """

    names: dict[str, int] = field(default_factory=dict)
    broken: dict[str, str] = field(default_factory=dict)
    labels: dict[str, int] = field(default_factory=dict)
    _tracks: "array[int]" = field(default_factory=lambda: array("q"))
    _numbers: "array[float]" = field(default_factory=lambda: array("d"))
    _texts: "array[int]" = field(default_factory=lambda: array("q"))

    @property
    def tracks(self) -> Index:
        """The number of the track of each line (N,)."""
        return np.frombuffer(self._tracks, dtype=np.int64)

    @property
    def texts(self) -> Index:
        """The number of the class name of each line (N,)."""
        return np.frombuffer(self._texts, dtype=np.int64)

    def numbers(self, columns: int) -> Array:
        """The numbers of each line (N, columns)."""
        return np.frombuffer(self._numbers).reshape(-1, columns)

    def add(self, tracks: Sequence[int], numbers: bytes, texts: Sequence[int]) -> None:
        """Append lines; `numbers` are their float64 values."""
        self._tracks.extend(tracks)
        self._numbers.frombytes(numbers)
        self._texts.extend(texts)

    def __len__(self) -> int:
        return len(self._tracks)


def check_lines(body: bytes, bounds: Bounds) -> None:
    """Check the number of lines before anything is read; an end of each kind counts.

    Raises:
        TooManyError: more than the bounds allow.
    """
    count = body.count(b"\n") + body.count(b"\r") - body.count(b"\r\n")
    if bounds.lines is not None and count > bounds.lines:
        raise TooManyError(
            f"lines: at most {bounds.lines} a request are taken, got {count}; "
            "post a part of the time at once"
        )


def read_lines(body: bytes, head: Head, plan: Plan, bounds: Bounds) -> Lines:
    """Read the columns of a plan of all lines; a bad line costs its own track only.

    Raises:
        TooManyError: more ids or broken tracks than the bounds allow.
    """
    lines = Lines()
    for first_no, block in _blocks(body):
        check_effort()
        if first_no <= head.header_no or not _read_even(lines, block, head, plan):
            for line_no, line in enumerate(block, start=first_no):
                if line_no != head.header_no and not line.isspace() and line[0] != "#":
                    _read_line(lines, line_no, line, head, plan)
        if bounds.ids is not None and len(lines.names) > bounds.ids:
            raise TooManyError(f"ids: at most {bounds.ids} of all classes are taken, got more")
        if bounds.broken is not None and len(lines.broken) > bounds.broken:
            if len(lines):
                raise TooManyError(
                    f"tracks: at most {bounds.broken} a request are taken, "
                    f"got {len(lines.broken)} or more"
                )
            break
    return lines


def _blocks(body: bytes) -> Iterator[tuple[int, list[str]]]:
    """Yield a thousand lines at once, with the number of the first."""
    text = TextIOWrapper(BytesIO(body), encoding="utf-8-sig", errors="replace")
    first_no = 1
    while block := list(islice(text, _BLOCK)):
        yield first_no, block
        first_no += len(block)


def _read_even(lines: Lines, block: list[str], head: Head, plan: Plan) -> bool:
    """Read a block at once, twice as fast, if all its lines are right; else read none of it."""
    if not head.cells or max(map(len, block)) > MAX_LINE_CHARS:  # no cells: only blank lines
        return False
    if head.decimal_comma:
        block = [line.replace(",", ".") for line in block]
    separator = head.separator
    if separator is None or plan.text_at is not None:
        rows = [line.split(separator) for line in block]
        if set(map(len, rows)) != {head.cells}:
            return False
        names = [row[plan.id_at].strip() for row in rows]
        texts = [] if plan.text_at is None else [row[plan.text_at] for row in rows]
    else:
        if set(map(str.count, block, repeat(separator))) != {head.cells - 1}:
            return False
        until = plan.id_at + 1
        names = [line.split(separator, until)[plan.id_at].strip() for line in block]
        texts = []
    try:
        read = np.loadtxt(block, delimiter=separator, usecols=plan.numbers, comments=None, ndmin=2)
    except ValueError:
        return False
    if len(read) < len(block) or not all(names) or '"' in "".join(names):
        return False
    known = lines.names
    lines.add(
        [known.setdefault(name[:MAX_ID_LENGTH], len(known)) for name in names],
        read.tobytes(),
        [_label(lines, text.strip().strip('"')) for text in texts],
    )
    return True


def _read_line(lines: Lines, line_no: int, line: str, head: Head, plan: Plan) -> None:
    cells = head.split(line) if len(line) <= MAX_LINE_CHARS else []
    has_id = len(cells) > plan.id_at
    name = cells[plan.id_at][:MAX_ID_LENGTH] if has_id else f"line {line_no}"
    at = lines.names.setdefault(name, len(lines.names))
    if name in lines.broken and (len(lines) or line_no > _TRIED):
        return
    if len(cells) == head.count + 1 and cells[-1] == "":
        del cells[-1]
    try:
        if len(cells) != head.count or not cells:
            got = len(cells) if cells else f"{len(line)} characters"
            raise ValueError(
                f"{head.count} columns separated by {head.separated_by} and at most "
                f"{MAX_LINE_CHARS} characters are needed, got {got}"
            )
        numbers = array("d", [_number(cells[each], each, plan) for each in plan.numbers])
    except ValueError as error:
        shown = line[:MAX_LINE_CHARS].strip()[:80]
        lines.broken.setdefault(name, f"line {line_no}: {error}; got {shown!r}")
        return
    texts = [] if plan.text_at is None else [_label(lines, cells[plan.text_at])]
    lines.add([at], numbers.tobytes(), texts)


def _number(cell: str, at: int, plan: Plan) -> float:
    try:
        return float(cell)
    except ValueError:
        if at in plan.free or at not in plan.needed and is_missing(cell):
            return float("nan")
        raise ValueError(f"column {at + 1} must be a number") from None


def _label(lines: Lines, text: str) -> int:
    return lines.labels.setdefault(text[:MAX_ID_LENGTH], len(lines.labels))
