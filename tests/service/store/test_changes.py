"""Whether anybody has changed the database: the number that kept answers hang on."""

import subprocess
import sys

import pytest
from sqlalchemy import text

from service.api.middleware.direct.kept import Kept
from service.store.engines.sqlite import Changes
from service.store.engines.store import Store

_WRITTEN = "INSERT OR REPLACE INTO store_probes VALUES (1, datetime('now'))"


@pytest.fixture
def changes(settings):
    made = Changes(settings.database_path)
    yield made
    made.close()


@pytest.fixture
def store(settings):
    made = Store(settings)
    yield made
    made.close()


def write(store):
    with store.write() as session:
        session.execute(text(_WRITTEN))


def write_elsewhere(settings):
    """The same in another process."""
    words = (
        "import sqlite3, sys; c = sqlite3.connect(sys.argv[1]); c.execute(sys.argv[2]); c.commit()"
    )
    path = str(settings.database_path)
    subprocess.run([sys.executable, "-c", words, path, _WRITTEN], check=True)


def test_the_number_stays_until_somebody_commits(changes, store, settings):
    first = changes.version()
    with store.read() as session:
        session.execute(text("SELECT * FROM store_probes")).all()
    with store.write():
        assert changes.version() == first  # who holds the lock has committed nothing
    assert changes.version() == first
    write(store)
    second = changes.version()
    assert second != first
    write_elsewhere(settings)
    assert changes.version() not in (first, second)


def test_what_is_rolled_back_is_no_change(changes, store):
    first = changes.version()
    with store.read() as session:
        session.execute(text(_WRITTEN))
        session.rollback()
    assert changes.version() == first


def test_it_waits_for_nobody_and_keeps_nobody_waiting(changes, store, settings):
    changes.version()
    with store.write() as session:
        session.execute(text("DELETE FROM store_probes"))
        assert changes.version() is not None
    # Nor does it hold on to the log: that can be emptied.
    with store.engine.connect() as connection:
        row = connection.exec_driver_sql("PRAGMA wal_checkpoint(TRUNCATE)").one()
    assert row[0] == 0


def test_where_the_number_cannot_be_told_nothing_is_kept(tmp_path):
    changes = Changes(tmp_path / "none.db")
    kept: Kept[str] = Kept(changes)
    version = kept.version()
    assert version is None
    kept.keep("a", "value", version)
    assert kept.find("a") is None
    changes.close()


def test_values_are_kept_until_a_commit(changes, store):
    kept: Kept[str] = Kept(changes)
    kept.keep("a", "old", kept.version())
    kept.version()
    assert kept.find("a") == "old"
    write(store)
    kept.version()
    assert kept.find("a") is None


def test_what_was_read_before_a_commit_is_not_kept_after_it(changes, store):
    kept: Kept[str] = Kept(changes)
    before = kept.version()
    write(store)
    kept.version()  # of another request, meanwhile
    kept.keep("a", "old", before)
    assert kept.find("a") is None
