"""Cameras that are copies of others in a store, with all that is known of them.

So hundreds stand there with their references learned and their windows full, within a minute.
"""

from collections.abc import Sequence
from pathlib import Path

from sqlalchemy import Column, Table

from service.store.sqlite.files import connected
from service.store.tables.record import Record

# In the order in which one names rows of another.
_TABLES = (
    "cameras",
    "prior_poses",
    "site_references",
    "flow_maps",
    "anchors",
    "tracks",
    "track_sources",
    "camera_rhythms",
    "estimates",
)
_TRACK_IDS = ("looked_at_pk", "newest_track_pk")  # they name tracks without a foreign key


def clone(database: Path, prototypes: Sequence[str], ids: Sequence[str]) -> None:
    """Copy cameras in turn, under other ids, in a store that nobody else uses."""
    with connected(database) as connection:
        largest = [
            connection.execute(f"SELECT coalesce(max(id), 0) FROM {name}").fetchone()[0]
            for name in ("prior_poses", "site_references", "tracks", "estimates")
        ]
        shift = max(largest) + 1
        connection.execute("BEGIN IMMEDIATE")
        for number, camera_id in enumerate(ids, start=1):
            given = {
                "old": prototypes[number % len(prototypes)],
                "new": camera_id,
                "by": number * shift,
            }
            for name in _TABLES:
                connection.execute(_copying(Record.metadata.tables[name]), given)
        connection.execute("COMMIT")


def _copying(table: Table) -> str:
    """The statement that copies the rows of a camera; their numbers are moved out of the way."""
    names = ", ".join(column.name for column in table.columns)
    values = ", ".join(_copied(column) for column in table.columns)
    key = "id" if table.name == "cameras" else "camera_id"
    where = f"{key} = :old"
    if key not in table.columns:
        where = "reference_id IN (SELECT id FROM site_references WHERE camera_id = :old)"
    return f"INSERT INTO {table.name} ({names}) SELECT {values} FROM {table.name} WHERE {where}"


def _copied(column: Column[object]) -> str:
    if column.name == "camera_id" or (column.table.name == "cameras" and column.name == "id"):
        return ":new"
    named = column.primary_key or column.foreign_keys or column.name in _TRACK_IDS
    return f"{column.name} + :by" if named and column.type.python_type is int else column.name
