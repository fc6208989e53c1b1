"""The form of a table by its first lines: separator, header, number of columns, text columns."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from io import StringIO

import numpy as np

from models.geometry.rotation import Array
from surefoot.tabular.columns import role_of

_BYTES, _LINES = 64 * 1024, 1_000
_FEWEST_CELLS = 4  # track_id, time_s, u_px, v_px
_SEPARATORS = {";": "semicolons", "\t": "tabs", ",": "commas", None: "blanks"}
_MISSING = frozenset(("", "nan", "none", "null", "na"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Head:
    """The form of a table.

    `separator` is None for runs of blanks. A line has `cells`, the last of which is empty where
    lines end with a separator, and `count` columns. The header is line `header_no`, 0 if there is
    none. `texts` tells which columns are mostly text, `some_text` which have any text; `sample`
    (N, count) are the first lines' numbers.
    """

    separator: str | None
    decimal_comma: bool
    header: tuple[str, ...] | None
    header_no: int
    cells: int
    count: int
    texts: tuple[bool, ...]
    some_text: tuple[bool, ...]
    sample: Array

    @property
    def separated_by(self) -> str:
        """The separator in words."""
        return _SEPARATORS[self.separator]

    def split(self, line: str) -> list[str]:
        """Return the cells of a line, without quotes and blanks around them."""
        if self.decimal_comma:
            line = line.replace(",", ".")
        return _split(line, self.separator)


def is_missing(cell: str) -> bool:
    """Return True for a cell that stands for no value."""
    return cell.lower() in _MISSING


def read_head(body: bytes) -> Head:
    """Return the form of a table by its first lines."""
    text = body[:_BYTES].decode("utf-8-sig", errors="replace")
    lines = [
        (number, line)
        for number, line in enumerate(StringIO(text, newline=None), start=1)
        if line.strip()
    ][:_LINES]
    if len(body) > _BYTES and len(lines) > 1:
        lines.pop()  # it may have been cut
    separator = _separator_of([line for _, line in lines])
    rows = [(number, _split(line, separator)) for number, line in lines]
    header, header_no = None, 0
    if rows and _is_header(rows[0][1]):
        header_no, first = rows.pop(0)
        header = tuple(cell.lstrip("#").strip() for cell in first)
    data = [cells for _, cells in rows if not cells[0].startswith("#")]
    cells = Counter(map(len, data)).most_common(1)[0][0] if data else len(header or ())
    data = [row for row in data if len(row) == cells]
    named = header is not None and len(header) >= cells and header[-1] != ""
    ended = separator and data and not named and all(row[-1] == "" for row in data)
    count = cells - 1 if ended else cells
    decimal_comma = separator in (";", "\t") and any("," in cell for row in data for cell in row)
    if decimal_comma:
        data = [[cell.replace(",", ".") for cell in row] for row in data]
    shares = [_text_share([row[at] for row in data]) for at in range(count)]
    sample = np.array(
        [[_number(row[at]) for at in range(count)] for row in data], dtype=np.float64
    ).reshape(len(data), count)
    return Head(
        separator=separator,
        decimal_comma=decimal_comma,
        header=header,
        header_no=header_no,
        cells=cells,
        count=count,
        texts=tuple(share > 0.5 for share in shares),
        some_text=tuple(share > 0 for share in shares),
        sample=sample,
    )


def _separator_of(lines: Sequence[str]) -> str | None:
    for separator in (";", "\t", ","):
        counts = Counter(line.count(separator) for line in lines)
        if counts and counts.most_common(1)[0][0] >= _FEWEST_CELLS - 1:
            return separator
    if any(len(line.split()) >= _FEWEST_CELLS for line in lines):
        return None
    return next((mark for mark in (",", ";", "\t") if any(mark in line for line in lines)), None)


def _split(line: str, separator: str | None) -> list[str]:
    if separator is None:
        return [cell.strip('"') for cell in line.split()]
    return [cell.strip().strip('"') for cell in line.strip("\r\n").split(separator)]


def _is_header(cells: Sequence[str]) -> bool:
    """Return True if the first line has names, not values."""
    if len(cells) < 2 or any(_is_number(cell) for cell in cells):
        return False
    return len(cells) >= _FEWEST_CELLS or any(role_of(cell.lstrip("# ")) for cell in cells)


def _text_share(cells: Sequence[str]) -> float:
    """Return the share of cells that are no number, of those that have a value."""
    known = [cell for cell in cells if not is_missing(cell)]
    return 1 - sum(map(_is_number, known)) / len(known) if known else 0.0


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return not is_missing(cell)


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return float("nan")
