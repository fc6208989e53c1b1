"""Move what an SQLite file holds to a PostgreSQL database, and check that all of it is there."""

import hashlib
import sqlite3
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psycopg

from models.regression.recipe import weights_path
from service.commands.postgresql.migrating import migrate_server
from service.data_dir import DATABASE, StartError, held_alone, require_stopped
from service.settings import Settings
from service.store import moving
from service.store.engines import files
from service.store.engines.failures import telling_of_server
from service.store.engines.revisions import known_revisions

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Moved:
    """The content of the server's database, checked: rows by table, and weights."""

    rows: dict[str, int]
    weights: int
    missing_weights: int


def move(source: Path, settings: Settings, tell: Progress) -> Moved:
    """Move the rows and weights of a data directory; the file stays as it is.

    Cut off, or run again, it goes on where it was. What the job engine had queued is queued anew by
    the first worker.

    `tell` is called with table, rows done and rows in all.

    Raises:
        StartError: the file is in use or of another revision, the database holds another site, or
            what came of it differs.
    """
    folder, head = source.parent, known_revisions()[0]
    if source.name != DATABASE or not source.is_file():
        raise StartError(f"--from: {source} is no {DATABASE} of a data directory")
    with held_alone(folder), telling_of_server(settings.store_url):
        require_stopped(folder)
        found = files.revision(source)
        if found != head:
            raise StartError(
                f"--from: {source} is of revision {found}, {head} is needed; bring it there by "
                f"`surefoot migrate --data-dir {folder}`"
            )
        migrate_server(settings)
        url = settings.store_url.replace("+psycopg", "")
        try:
            with files.connected(source) as read, psycopg.connect(url) as written:
                return _moved(read, written, folder / "weights", tell)
        except psycopg.Error as error:
            said = " ".join(str(error).split())[:300]
            raise StartError(f"--to: {said}; run it again, it goes on where it was") from error


def _moved(
    read: sqlite3.Connection, written: psycopg.Connection[Any], weights: Path, tell: Progress
) -> Moved:
    ids = {str(row[0]) for row in read.execute("SELECT id FROM cameras")}
    if foreign := moving.count_foreign(written, ids):
        raise StartError(f"--to: {foreign} cameras are there that --from has not: another site's")
    written.commit()
    tables = moving.moved_tables()
    for table in tables:
        moving.move_table(read, written, table, tell)
    rows = {}
    for table in tables:
        there = moving.fingerprint(moving.rows_of_file(read, table))
        here = moving.fingerprint(moving.rows_of_server(written, table))
        if there != here:
            raise StartError(
                f"check: {table.name} has {there[0]} rows with the hash {there[1][:16]} in the "
                f"file, {here[0]} with {here[1][:16]} on the server"
            )
        rows[table.name] = here[0]
    named = {str(row[0]) for row in read.execute("SELECT weights_sha256 FROM models")}
    kept = [sha256 for sha256 in sorted(named) if _keep(written, weights, sha256)]
    written.commit()
    return Moved(rows=rows, weights=len(kept), missing_weights=len(named) - len(kept))


def _keep(written: psycopg.Connection[Any], folder: Path, sha256: str) -> bool:
    path = weights_path(folder, sha256)
    data = path.read_bytes() if path.is_file() else b""
    if hashlib.sha256(data).hexdigest() != sha256:
        return False  # its camera is trained anew
    moving.keep_weights(written, sha256, data)
    return True
