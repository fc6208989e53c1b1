"""Rows of an SQLite file to a server's database, as they are: nothing is read and written anew."""

import hashlib
import sqlite3
from collections.abc import Callable, Iterator
from datetime import datetime
from typing import Any

import psycopg
from psycopg import sql
from sqlalchemy import JSON, Boolean, Column, DateTime, LargeBinary, Table

from service.store.record import Record

_BITE = 2_000
_SUM = 2**256
# Of the processes of the machine that the file was on, and of the server itself.
_LEFT = ("workers", "bridges", "store_probes", "weights")
Row = tuple[Any, ...]
Progress = Callable[[str, int, int], None]  # table, done, total


def moved_tables() -> list[Table]:
    """The tables whose rows are moved; each comes after those that it refers to."""
    return [table for table in Record.metadata.sorted_tables if table.name not in _LEFT]


def move_table(
    source: sqlite3.Connection, target: psycopg.Connection[Any], table: Table, tell: Progress
) -> None:
    """Copy the rows that are not there yet, so many a transaction, and go on with its numbering.

    Cut off, it goes on where it was.
    """
    total = source.execute(f"SELECT count(*) FROM {table.name}").fetchone()[0]
    begun = _last_number(target, table)
    names = [column.name for column in table.columns]
    wanted = sql.SQL(", ").join(map(sql.Identifier, names))
    name = sql.Identifier(table.name)
    done = 0
    for rows in _bites(source, table, begun):
        with target.transaction(), target.cursor() as cursor:
            cursor.execute(
                sql.SQL("CREATE TEMP TABLE moving (LIKE {}) ON COMMIT DROP").format(name)
            )
            with cursor.copy(sql.SQL("COPY moving ({}) FROM STDIN").format(wanted)) as copy:
                for row in rows:
                    copy.write_row(row)
            cursor.execute(
                sql.SQL(
                    "INSERT INTO {0} ({1}) SELECT {1} FROM moving ON CONFLICT DO NOTHING"
                ).format(name, wanted)
            )
        done += len(rows)
        tell(table.name, done, total)
    _number_on(source, target, table)


def fingerprint(rows: Iterator[Row]) -> tuple[int, str]:
    """The number of rows, and a hash of them all that no order changes."""
    count = total = 0
    for row in rows:
        count += 1
        total += int.from_bytes(hashlib.sha256(repr(row).encode()).digest(), "big")
    return count, f"{total % _SUM:064x}"


def rows_of_file(source: sqlite3.Connection, table: Table) -> Iterator[Row]:
    """All rows of a table, each value as both databases say it."""
    columns = list(table.columns)
    names = ", ".join(f'"{column.name}"' for column in columns)
    for row in source.execute(f"SELECT {names} FROM {table.name}"):
        yield tuple(_said(column, value) for column, value in zip(columns, row, strict=True))


def rows_of_server(target: psycopg.Connection[Any], table: Table) -> Iterator[Row]:
    """The same of the server's."""
    columns = list(table.columns)
    # JSON as the text that it is.
    names = sql.SQL(", ").join(
        sql.SQL("{}::text" if _is_json(column) else "{}").format(sql.Identifier(column.name))
        for column in columns
    )
    query = sql.SQL("SELECT {} FROM {}").format(names, sql.Identifier(table.name))
    with target.transaction(), target.cursor(name="moving") as cursor:
        cursor.itersize = _BITE
        cursor.execute(query)
        for row in cursor:
            yield tuple(_said(column, value) for column, value in zip(columns, row, strict=True))


def count_foreign(target: psycopg.Connection[Any], ids: set[str]) -> int:
    """The number of the server's cameras that are none of these."""
    return sum(row[0] not in ids for row in target.execute("SELECT id FROM cameras"))


def keep_weights(target: psycopg.Connection[Any], sha256: str, data: bytes) -> None:
    """Put the weights of a model beside it."""
    target.execute(
        "INSERT INTO weights (sha256, data, stored_at) VALUES (%s, %s, now() AT TIME ZONE 'UTC') "
        "ON CONFLICT DO NOTHING",
        (sha256, data),
    )


def _bites(source: sqlite3.Connection, table: Table, begun: int | None) -> Iterator[list[Row]]:
    names = ", ".join(f'"{column.name}"' for column in table.columns)
    key = ", ".join(column.name for column in table.primary_key.columns)
    where = "" if begun is None else f"WHERE {key} > {begun}"
    # Groups of alerts before their members.
    order = f"camera_id IS NOT NULL, {key}" if table.name == "alerts" else key
    cursor = source.execute(f"SELECT {names} FROM {table.name} {where} ORDER BY {order}")
    while rows := cursor.fetchmany(_BITE):
        yield rows


def _last_number(target: psycopg.Connection[Any], table: Table) -> int | None:
    """The last row that is there already, of a table whose rows are numbered."""
    key = _numbers(table)
    if key is None:
        return None
    query = sql.SQL("SELECT max({}) FROM {}")
    found = target.execute(query.format(sql.Identifier(key.name), sql.Identifier(table.name)))
    last: int | None = next(found)[0]
    target.commit()
    return last


def _number_on(source: sqlite3.Connection, target: psycopg.Connection[Any], table: Table) -> None:
    """Have new rows numbered on from the last that ever was, also of those that are deleted."""
    key = _numbers(table)
    if key is None:
        return
    last = source.execute(f"SELECT coalesce(max({key.name}), 0) FROM {table.name}").fetchone()[0]
    given = source.execute("SELECT seq FROM sqlite_sequence WHERE name = ?", (table.name,))
    last = max(last, *(row[0] for row in given), 0)
    if last:
        sequence = f"pg_get_serial_sequence('{table.name}', '{key.name}')"
        target.execute(f"SELECT setval({sequence}, %s)", (last,))
        target.commit()


def _numbers(table: Table) -> Column[Any] | None:
    """The column that numbers the rows of a table."""
    column: Column[Any] | None = table.autoincrement_column
    return None if column is None or column.foreign_keys else column


def _is_json(column: Column[Any]) -> bool:
    return isinstance(getattr(column.type, "impl", column.type), JSON)


def _said(column: Column[Any], value: Any) -> Any:
    """A value as both say it: times as times, truths as truths, bytes by their hash."""
    kind = getattr(column.type, "impl", column.type)
    if value is None:
        return None
    if isinstance(kind, DateTime):
        return datetime.fromisoformat(value) if isinstance(value, str) else value
    if isinstance(kind, Boolean):
        return bool(value)
    if isinstance(kind, LargeBinary):
        return hashlib.sha256(value).hexdigest()
    return float(value) if kind.python_type is float else value
