import sqlite3

import alembic.command
import pytest
from sqlalchemy import text
from sqlalchemy.exc import IntegrityError

from service.migrate import alembic_config, migrate
from service.settings import Settings
from service.store.database import Store
from service.store.tables import Record


def test_migrating_twice_changes_nothing(settings):
    migrate(settings)


def test_the_migrated_tables_are_the_declared_ones(settings):
    alembic.command.check(alembic_config(settings.database_url))


def test_down_to_nothing_and_up_again(tmp_path):
    settings = Settings(data_dir=tmp_path)
    config = alembic_config(settings.database_url)
    alembic.command.upgrade(config, "head")
    alembic.command.downgrade(config, "base")
    with sqlite3.connect(settings.database_path) as connection:
        left = {row[0] for row in connection.execute("SELECT name FROM sqlite_master")}
    assert left <= {"alembic_version", "sqlite_sequence", "sqlite_autoindex_alembic_version_1"}
    alembic.command.upgrade(config, "head")


def test_the_file_is_in_wal_mode_with_foreign_keys(settings):
    with Store(settings).read() as session:
        assert session.scalar(text("PRAGMA journal_mode")) == "wal"
        assert session.scalar(text("PRAGMA foreign_keys")) == 1
        assert session.scalar(text("PRAGMA busy_timeout")) == 30000


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
