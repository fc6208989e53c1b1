"""Archives and data directories whose schema is not the schema of their revision."""

import sqlite3

import pytest

from service.commands.migrate import migrate
from service.data_dir import StartError
from service.job_queue import ENGINE_TABLES
from service.operations.backup import write_backup
from service.operations.check import check_data_dir
from service.operations.restore import restore_backup
from service.store.engines import files
from service.store.engines.schemas import schema_faults
from service.store.record import Record
from tests.service.store.test_backup import doctored, quiet, with_model
from tests.stores.databases import only_sqlite

pytestmark = only_sqlite("archives are of files")

FAULTS = {
    "table": (["DROP TABLE zones"], "missing table zones"),
    "models": (["DROP TABLE models"], "missing table models"),
    "revision": (["DROP TABLE alembic_version"], "missing table alembic_version, or its row"),
    "no revision": (["DELETE FROM alembic_version"], "missing table alembic_version, or its row"),
    "column": (
        ["ALTER TABLE cameras DROP COLUMN snapshot_error"],
        "missing column cameras.snapshot_error VARCHAR",
    ),
    "added column": (
        ["ALTER TABLE cameras ADD COLUMN owner TEXT"],
        "unknown column cameras.owner TEXT",
    ),
    "index": (
        ["DROP INDEX uq_alerts_firing"],
        "missing unique index uq_alerts_firing on alerts (camera_id, kind) where state = 'firing'",
    ),
    "weaker index": (
        [
            "DROP INDEX uq_alerts_firing",
            "CREATE INDEX uq_alerts_firing ON alerts (camera_id, kind) WHERE state = 'firing'",
        ],
        "missing unique index uq_alerts_firing on alerts (camera_id, kind) where state = 'firing'",
    ),
    "trigger": (
        ["DROP TRIGGER activity_unchanged"],
        "missing trigger activity_unchanged before update on activity "
        "begin select raise(abort, 'activity: entries are never changed'); end",
    ),
    "unique index": (
        ["CREATE UNIQUE INDEX one ON tracks (camera_id)"],
        "unknown unique index one on tracks (camera_id)",
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_archive_with_another_schema_is_refused(settings, tmp_path, name):
    """An archive without a table was restored, and `check` reported `ok`."""
    statements, fault = FAULTS[name]
    archive = tmp_path / "b.tar"
    write_backup(settings, archive, quiet)
    before = settings.database_path.read_bytes()
    with pytest.raises(StartError) as refused:
        restore_backup(settings, doctored(archive, *statements), quiet, force=True)
    assert str(refused.value).startswith("schema: the backup differs from its revision: ")
    assert fault in str(refused.value)
    assert settings.database_path.read_bytes() == before


@pytest.mark.parametrize("name", FAULTS)
def test_check_reports_another_schema(settings, tmp_path, name):
    statements, fault = FAULTS[name]
    with sqlite3.connect(settings.database_path) as connection:
        for statement in statements:
            connection.execute(statement)
    (found,) = [one for one in check_data_dir(settings) if one.what == "schema"]
    assert found.verdict == "fault"
    assert fault in found.detail
    with pytest.raises(StartError, match="differs from its revision"):
        write_backup(settings, tmp_path / "b.tar", quiet)


@pytest.mark.parametrize("table", sorted(Record.metadata.tables))
def test_every_missing_table_is_a_fault(settings, table):
    with sqlite3.connect(settings.database_path) as connection:
        connection.execute(f"DROP TABLE {table}")
    assert f"missing table {table}" in schema_faults(settings.database_path)


def test_own_schema_and_plain_additions_are_no_fault(settings):
    assert schema_faults(settings.database_path) == []
    with sqlite3.connect(settings.database_path) as connection:
        connection.execute("CREATE TABLE notes (words TEXT)")
        connection.execute("CREATE INDEX more ON tracks (ended_s)")
    assert schema_faults(settings.database_path) == []


def test_job_tables_that_an_archive_does_not_have_are_made_by_the_next_start(settings, tmp_path):
    with_model(settings)
    archive = tmp_path / "b.tar"
    write_backup(settings, archive, quiet)
    fresh = settings.model_copy(update={"data_dir": tmp_path / "fresh"})
    restore_backup(fresh, doctored(archive, "DROP TABLE queues"), quiet, force=False)
    (found,) = [one for one in check_data_dir(fresh) if one.what == "job engine"]
    assert (found.verdict, found.detail) == ("note", "no tables; the next start makes them")
    migrate(fresh)
    assert set(ENGINE_TABLES) <= files.tables(fresh.database_path)
    assert {one.verdict for one in check_data_dir(fresh)} == {"ok"}
