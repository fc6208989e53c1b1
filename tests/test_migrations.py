import sqlite3

import alembic.command
import pytest
from alembic.script import ScriptDirectory
from sqlalchemy import text
from sqlalchemy.exc import IntegrityError

from service.commands.migrate import migrate
from service.settings import Settings
from service.store.engines.revisions import alembic_config, known_revisions
from service.store.engines.store import Store
from service.store.record import Record
from tests.stores.databases import only_sqlite


def test_migrating_twice_changes_nothing(settings):
    migrate(settings)


def test_the_migrated_tables_are_the_declared_ones(settings):
    alembic.command.check(alembic_config(settings.store_url))


def test_the_known_revisions_are_alembics():
    scripts = ScriptDirectory.from_config(alembic_config(""))
    assert known_revisions() == [script.revision for script in scripts.walk_revisions()]


def test_down_to_nothing_and_up_again(tmp_path):
    settings = Settings(data_dir=tmp_path)
    config = alembic_config(settings.store_url)
    alembic.command.upgrade(config, "head")
    alembic.command.downgrade(config, "base")
    with sqlite3.connect(settings.database_path) as connection:
        left = {row[0] for row in connection.execute("SELECT name FROM sqlite_master")}
    assert left <= {"alembic_version", "sqlite_sequence", "sqlite_autoindex_alembic_version_1"}
    alembic.command.upgrade(config, "head")


def test_both_ways_on_whichever_database(settings):
    config = alembic_config(settings.store_url)
    alembic.command.downgrade(config, "base")
    alembic.command.upgrade(config, "head")
    alembic.command.check(config)


# A word for each column that takes those of a vocabulary alone.
WORDS = {
    "estimation_run_hours": {"kind": "full"},
    "cameras": {"projection": "perspective"},
    "prior_poses": {"origin": "registered"},
    "site_references": {"origin": "registered"},
    "trainings": {"state": "succeeded"},
    "estimates": {"state": "ok"},
    "alerts": {"kind": "drift", "state": "firing", "source": "estimate", "severity": "warning"},
    "events": {"type": "pose"},
    "webhooks": {"format": "webhook"},
    "deliveries": {"type": "test", "state": "pending"},
    "activity": {"what": "camera.changed"},
}


def put(connection, table, **values):
    """Insert a row with something in every column that needs it."""
    some = {"JSON": "[]", "DATETIME": "2026-11-20 08:00:00", "BLOB": b""}
    for _, name, kind, needed, default, key in connection.execute(f"PRAGMA table_info({table})"):
        if needed and default is None and not (key and kind == "INTEGER"):
            number = kind in ("INTEGER", "DOUBLE", "FLOAT", "BOOLEAN")
            word = WORDS.get(table, {}).get(name, "some")
            values.setdefault(name, some.get(kind, 1 if number else word))
    names = ", ".join(values)
    marks = ", ".join("?" * len(values))
    connection.execute(f"INSERT INTO {table} ({names}) VALUES ({marks})", list(values.values()))


@only_sqlite("looks at the file")
def test_the_file_is_in_wal_mode_with_foreign_keys(settings):
    with Store(settings).read() as session:
        assert session.scalar(text("PRAGMA journal_mode")) == "wal"
        assert session.scalar(text("PRAGMA foreign_keys")) == 1
        assert session.scalar(text("PRAGMA busy_timeout")) == 30000


@only_sqlite("looks at the file")
def test_a_track_needs_its_camera(settings):
    insert = text(
        "INSERT INTO tracks (camera_id, source, track_id, started_s, ended_s, points, received_at)"
        " VALUES ('nobody', 's', '1', 0, 1, x'', '2026-01-01')"
    )
    with pytest.raises(IntegrityError, match="FOREIGN KEY"), Store(settings).write() as session:
        session.execute(insert)


def test_every_constraint_has_a_name(settings):
    for table in Record.metadata.sorted_tables:
        for constraint in table.constraints:
            assert constraint.name, (table.name, constraint)
