"""Alerts as lines of CSV, which a spreadsheet opens without running what a tracker named itself."""

import csv
from collections.abc import Sequence
from enum import StrEnum
from io import StringIO

from service.notifications.outbox import alert_body
from service.store.alerts import AlertRecord

_COLUMNS = (
    *("id", "camera_id", "kind", "state", "severity", "reason", "opened_at", "changed_at"),
    *("acknowledged_by", "acknowledged_at", "silenced_until", "silenced_by", "resolved_at"),
    *("resolved_by", "outcome", "note", "track_source", "group_id"),
)
_FORMULA = ("=", "+", "-", "@", "\t", "\r")  # how a cell begins that is computed


class AlertFormat(StrEnum):
    """The formats of a list of alerts beside JSON."""

    CSV = "csv"


def alerts_csv(records: Sequence[AlertRecord]) -> str:
    """The alerts, a line each below their columns' names; no cell is taken for a formula."""
    text = StringIO()
    lines = csv.writer(text)
    lines.writerow(_COLUMNS)
    for record in records:
        body = alert_body(record)
        lines.writerow([_plain(body[name]) for name in _COLUMNS])
    return text.getvalue()


def _plain(value: str | None) -> str:
    text = "" if value is None else str(value)
    return f"'{text}" if text.startswith(_FORMULA) else text
