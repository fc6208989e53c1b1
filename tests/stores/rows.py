"""Rows that a test puts into a store as they are, on whichever database."""

from collections.abc import Iterable
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import JSON, Boolean, Column, Connection, DateTime, LargeBinary, String

from service.formats.track import IncomingTrack
from service.store import tracks
from service.store.record import Record
from tests.test_migrations import WORDS

Row = dict[str, Any]


def row_of(table: str, **values: Any) -> Row:
    """A row with something in every column that needs it."""
    for column in Record.metadata.tables[table].columns:
        if not column.nullable and column.name not in values and not _numbered(column):
            values[column.name] = _something(table, column)
    return values


def put_rows(connection: Connection, table: str, rows: list[Row]) -> None:
    """Insert rows of the same columns, as the driver takes them: no value is converted."""
    sqlite = connection.dialect.name == "sqlite"
    marks = ", ".join(f":{name}" if sqlite else f"%({name})s" for name in rows[0])
    names = ", ".join(rows[0])
    connection.exec_driver_sql(f"INSERT INTO {table} ({names}) VALUES ({marks})", rows)


def put_tracks(connection: Connection, camera_id: str, found: Iterable[IncomingTrack]) -> None:
    """Store tracks as they are, whatever a post of them would have been answered."""
    rows = [
        {
            "camera_id": camera_id,
            "source": track.source,
            "track_id": track.track_id,
            "started_s": float(track.points[0, 0]),
            "ended_s": float(track.points[-1, 0]),
            "points": tracks.pack(track.points),
            "boxes": None if track.boxes is None else tracks.pack(track.boxes),
            "heads": None if track.heads is None else tracks.pack(track.heads),
            "received_at": datetime.now(UTC),
            "first_px": track.first_px,
        }
        for track in found
    ]
    tracks.add(connection, rows)


def _numbered(column: Column[Any]) -> bool:
    return column.primary_key and column.autoincrement is not False and not isinstance(
        column.type, String
    ) and not column.foreign_keys  # fmt: skip


def _something(table: str, column: Column[Any]) -> Any:
    kind = getattr(column.type, "impl", column.type)
    if isinstance(kind, Boolean):
        return True
    if isinstance(kind, JSON):
        return "[]"
    if isinstance(kind, DateTime):
        return "2026-11-20 08:00:00"
    if isinstance(kind, LargeBinary):
        return b""
    if isinstance(kind, String):
        return WORDS.get(table, {}).get(column.name, "some")
    assert kind.python_type in (int, float), column
    return 1
