"""SQL that the two databases write differently, each in one place."""

from datetime import UTC, datetime
from typing import Any

from sqlalchemy import (
    ColumnElement,
    Connection,
    Engine,
    Float,
    Insert,
    Integer,
    String,
    TableClause,
    text,
)
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.orm import Session
from sqlalchemy.sql.compiler import SQLCompiler
from sqlalchemy.sql.expression import SQLColumnExpression
from sqlalchemy.sql.functions import FunctionElement

_POSTGRESQL = "postgresql"


def is_sqlite(bind: Engine | Connection) -> bool:
    """True of a database that is an SQLite file."""
    return bind.dialect.name == "sqlite"


class largest(FunctionElement[float]):  # noqa: N801, named as functions of SQL are
    """The largest of several values of a row, none of which is NULL."""

    type = Float()
    inherit_cache = True
    name = "largest"


class whole(FunctionElement[int]):  # noqa: N801
    """A number without what is behind its point."""

    type = Integer()
    inherit_cache = True
    name = "whole"


class as_json(FunctionElement[str]):  # noqa: N801
    """A JSON column as the text that it is."""

    type = String()
    inherit_cache = True
    name = "as_json"


class earlier(FunctionElement[datetime]):  # noqa: N801
    """A time less a whole number of seconds; its microseconds stay."""

    inherit_cache = True
    name = "earlier"


class NewRows(Insert):
    """An insert that leaves out what is stored already."""

    inherit_cache = True


def new_rows(table: Any) -> NewRows:
    """An insert that leaves out what is stored already, by whichever constraint says so."""
    assert isinstance(table, TableClause)
    made: NewRows = NewRows(table).inline()  # nobody asks for the keys
    return made


@compiles(largest)
def _largest(element: largest, compiler: SQLCompiler, **kw: Any) -> str:
    return f"max({compiler.process(element.clauses, **kw)})"


@compiles(largest, _POSTGRESQL)
def _greatest(element: largest, compiler: SQLCompiler, **kw: Any) -> str:
    return f"greatest({compiler.process(element.clauses, **kw)})"


@compiles(whole)
def _whole(element: whole, compiler: SQLCompiler, **kw: Any) -> str:
    return f"CAST({compiler.process(element.clauses, **kw)} AS INTEGER)"


@compiles(whole, _POSTGRESQL)
def _trunc(element: whole, compiler: SQLCompiler, **kw: Any) -> str:
    return f"trunc({compiler.process(element.clauses, **kw)})::bigint"


@compiles(as_json)
def _as_json(element: as_json, compiler: SQLCompiler, **kw: Any) -> str:
    return compiler.process(element.clauses, **kw)


@compiles(as_json, _POSTGRESQL)
def _as_text(element: as_json, compiler: SQLCompiler, **kw: Any) -> str:
    return f"({compiler.process(element.clauses, **kw)})::text"


@compiles(earlier)
def _earlier(element: earlier, compiler: SQLCompiler, **kw: Any) -> str:
    time, seconds = (compiler.process(each, **kw) for each in element.clauses)
    # SQLite calculates to milliseconds alone: what is behind the point is taken as it is.
    whole_s = f"strftime('%Y-%m-%d %H:%M:%S', {time}, -{seconds} || ' seconds')"
    return f"{whole_s} || substr({time}, 20)"


@compiles(earlier, _POSTGRESQL)
def _before(element: earlier, compiler: SQLCompiler, **kw: Any) -> str:
    time, seconds = (compiler.process(each, **kw) for each in element.clauses)
    return f"{time} - make_interval(secs => {seconds})"


@compiles(NewRows)
def _new_rows(element: NewRows, compiler: SQLCompiler, **kw: Any) -> str:
    inserted: str = compiler.visit_insert(element, **kw)  # type: ignore[no-untyped-call]
    return f"{inserted} ON CONFLICT DO NOTHING"


def contains_word(column: SQLColumnExpression[Any], word: str) -> ColumnElement[bool]:
    """The condition that a JSON list of words has one."""
    return as_json(column).contains(f'"{word}"')


_NOW = text("SELECT clock_timestamp()")


def now_in(session: Session) -> datetime:
    """The time by the clock that all of a store share: this machine's, or the server's."""
    if is_sqlite(session.get_bind()):
        return datetime.now(UTC)
    now: datetime = session.scalars(_NOW).one()
    return now.astimezone(UTC)
