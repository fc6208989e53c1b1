"""Statements written out once, for the few that every post of tracks makes.

SQLite's driver takes some microseconds to run one. What SQLAlchemy adds each time, looking up how
it is written and wrapping what comes back, is several times that. A server takes longer than
either: there, SQLAlchemy runs them.
"""

import sqlite3
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from sqlalchemy import ClauseElement, Connection, CursorResult, Dialect, Executable, Select
from sqlalchemy.dialects.sqlite import pysqlite
from sqlalchemy.exc import DBAPIError
from sqlalchemy.sql.compiler import SQLCompiler

_DIALECT: Dialect = pysqlite.dialect()

Values = Mapping[str, Any]


class Prepared:
    """A statement of SQLAlchemy's that the driver runs itself, on a connection of SQLAlchemy's.

    Values are converted as SQLAlchemy does, and errors are SQLAlchemy's. Rows come as they are
    stored: columns whose values would have to be converted are not taken.

    Args:
        statement: what is to be run.
        columns: those that an insert fills; of any other, none.
    """

    def __init__(self, statement: ClauseElement, columns: Sequence[str] | None = None) -> None:
        self._statement = statement
        compiled = statement.compile(dialect=_DIALECT, column_keys=columns)
        assert isinstance(compiled, SQLCompiler)
        self._sql = str(compiled)
        # Of the statement's own, as a limit is; an insert's have no value before they are given.
        self._own = {name: value for name, value in compiled.params.items() if value is not None}
        self._values: list[tuple[str, Callable[[Any], Any] | None]] = [
            (name, compiled.binds[name].type.dialect_impl(_DIALECT).bind_processor(_DIALECT))
            for name in compiled.positiontup or ()
        ]
        if isinstance(statement, Select):
            for column in statement.selected_columns:
                kind = column.type.dialect_impl(_DIALECT)
                assert kind.result_processor(_DIALECT, None) is None, column

    def run(self, connection: Connection) -> None:
        """Run what takes no values and gives no rows."""
        with self._cursor(connection) as cursor:
            cursor.execute(self._sql)

    def row(self, connection: Connection, values: Values) -> tuple[Any, ...] | None:
        """The first row; None where there is none."""
        if connection.dialect.name != _DIALECT.name:
            found = self._executed(connection, values).first()
            return None if found is None else tuple(found)
        with self._cursor(connection) as cursor:
            cursor.execute(self._sql, self._in_order(values))
            row: tuple[Any, ...] | None = cursor.fetchone()
        return row

    def change(self, connection: Connection, *values: Values) -> int:
        """Change what is stored, by each of some values; how many rows that changed."""
        if connection.dialect.name != _DIALECT.name:
            return self._executed(connection, list(values)).rowcount
        with self._cursor(connection) as cursor:
            cursor.executemany(self._sql, [self._in_order(each) for each in values])
        return cursor.rowcount

    def _executed(self, connection: Connection, values: Any) -> CursorResult[Any]:
        assert isinstance(self._statement, Executable)
        return connection.execute(
            self._statement, values, execution_options={"preserve_rowcount": True}
        )

    @contextmanager
    def _cursor(self, connection: Connection) -> Iterator[sqlite3.Cursor]:
        driver: sqlite3.Connection | None = connection.connection.driver_connection
        assert driver is not None
        cursor = driver.cursor()
        try:
            yield cursor
        except sqlite3.Error as error:
            raise DBAPIError.instance(
                self._sql, None, error, sqlite3.Error, hide_parameters=True, dialect=_DIALECT
            ) from error
        finally:
            cursor.close()  # and with it a look at rows that goes on

    def _in_order(self, values: Values) -> list[Any]:
        values = {**self._own, **values} if self._own else values
        return [
            values[name] if convert is None else convert(values[name])
            for name, convert in self._values
        ]
