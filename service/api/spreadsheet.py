"""Lines of CSV, which a spreadsheet opens without running what a tracker named itself."""

import csv
import json
from collections.abc import Iterable
from datetime import datetime
from enum import StrEnum
from io import StringIO
from typing import Any

from service.notifications.outbox import json_time

CSV = "text/csv"
_FORMULA = ("=", "+", "-", "@", "\t", "\r")  # how a cell begins that is computed


class FileFormat(StrEnum):
    """The formats of a list beside JSON."""

    CSV = "csv"


def csv_lines(rows: Iterable[Iterable[Any]]) -> str:
    """A line for each row; no cell is taken for a formula."""
    text = StringIO()
    csv.writer(text).writerows([_plain(value) for value in row] for row in rows)
    return text.getvalue()


def saved_as(name: str) -> dict[str, str]:
    """The header by which a browser keeps an answer as a file."""
    return {"Content-Disposition": f'attachment; filename="{name}"'}


def _plain(value: Any) -> str:
    if isinstance(value, datetime):
        return json_time(value)
    if isinstance(value, dict):
        return json.dumps(value, ensure_ascii=False) if value else ""
    text = "" if value is None else str(value)
    return f"'{text}" if text.startswith(_FORMULA) else text
