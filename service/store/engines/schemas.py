"""The schema of a database file, compared with the schema that its revision declares."""

import functools
import sqlite3
import tempfile
from pathlib import Path

from service.data_dir import DATABASE, StartError
from service.store.engines import files
from service.store.engines.revisions import alembic_config


def require_schema(path: Path, what: str) -> None:
    """Check that a database of a known revision has the schema of that revision.

    Raises:
        StartError: a part is missing or differs; the message names up to three.
    """
    if found := schema_faults(path):
        more = f" and {len(found) - 3} more" if len(found) > 3 else ""
        raise StartError(
            f"schema: {what} differs from its revision: {'; '.join(found[:3])}{more}; restore a "
            "backup that is intact"
        )


def schema_faults(path: Path) -> list[str]:
    """Return the missing tables, columns, keys, indexes and triggers, then unknown ones.

    A missing table is one fault, not one per column. Tables and plain indexes that the revision
    does not declare are no fault: they change nothing that the service stores.
    """
    revision = files.revision(path)
    if revision is None:
        return ["missing table alembic_version, or its row"]
    expected, found = _declared(revision), _parts(path)
    gone = [table for table in expected if table not in found]
    faults = [f"missing table {table}" for table in gone]
    for table in expected.keys() - gone:
        faults += [f"missing {part}" for part in sorted(expected[table] - found[table])]
        added = sorted(found[table] - expected[table])
        faults += [f"unknown {part}" for part in added if not part.startswith("index")]
    return sorted(faults, key=lambda fault: (not fault.startswith("missing table"), fault))


@functools.cache
def _declared(revision: str) -> dict[str, frozenset[str]]:
    """The parts of each table of an empty database that the migrations build."""
    import alembic.command  # 0.1 s that a start with nothing to compare does not need

    with tempfile.TemporaryDirectory(prefix="surefoot-schema-") as folder:
        path = Path(folder) / DATABASE
        alembic.command.upgrade(alembic_config(f"sqlite:///{path}"), revision)
        return _parts(path)


def _parts(path: Path) -> dict[str, frozenset[str]]:
    """The columns, keys, indexes and triggers of each table, each as a line to compare."""
    with files.connected(path) as connection:
        return {
            table: frozenset(_parts_of(connection, table)) for table in sorted(files.tables(path))
        }


def _parts_of(connection: sqlite3.Connection, table: str) -> list[str]:
    parts = []
    for name, kind, needed, default, key in connection.execute(
        'SELECT name, type, "notnull", dflt_value, pk FROM pragma_table_info(?)', (table,)
    ):
        extra = f"{' NOT NULL' if needed else ''}{f' DEFAULT {default}' if default else ''}"
        parts.append(f"column {table}.{name} {kind}{extra}{f' KEY {key}' if key else ''}")
    for column, other, gone in connection.execute(
        'SELECT "from", "table", on_delete FROM pragma_foreign_key_list(?)', (table,)
    ):
        parts.append(f"foreign key {table}.{column} to {other}, on delete {gone}")
    for name, unique, origin, statement in connection.execute(
        "SELECT list.name, list.\"unique\", list.origin, coalesce(sql, '') "
        "FROM pragma_index_list(?) AS list LEFT JOIN sqlite_master AS made "
        "ON made.type = 'index' AND made.name = list.name",
        (table,),
    ):
        if origin == "pk":
            continue  # the columns name the primary key
        columns = connection.execute("SELECT name FROM pragma_index_info(?)", (name,)).fetchall()
        listed = ", ".join(str(column) for (column,) in columns)
        where = _words(statement).partition(" where ")[2]
        limit = f" where {where}" if where else ""
        named = "" if name.startswith("sqlite_autoindex_") else f" {name}"
        parts.append(f"{'unique ' if unique else ''}index{named} on {table} ({listed}){limit}")
    for (statement,) in connection.execute(
        "SELECT sql FROM sqlite_master WHERE type = 'trigger' AND tbl_name = ?", (table,)
    ):
        parts.append(f"trigger {_words(statement).partition('create trigger ')[2]}")
    return parts


def _words(statement: str) -> str:
    """A statement without quotes and without differences in blanks and capitals."""
    return " ".join(statement.replace('"', "").lower().split())
