"""Writers of several processes on SQLite, who wait for one another as long as they are told."""

import sqlite3
import threading
from contextlib import closing

import pytest
from sqlalchemy import text
from sqlalchemy.exc import OperationalError

from service.store.database.store import Store
from tests.stores.databases import only_sqlite

pytestmark = only_sqlite("a server has its own queue of who waits for a lock")
_WRITTEN = text("INSERT OR REPLACE INTO store_probes VALUES (1, datetime('now'))")


@pytest.fixture
def other(settings):
    """Another process's connection, which has the write lock."""
    path = settings.database_path
    with closing(sqlite3.connect(path, isolation_level=None, check_same_thread=False)) as made:
        made.execute("BEGIN IMMEDIATE")
        yield made


@pytest.fixture
def store(settings, other):
    made = Store(settings, patience_s=0.3)
    yield made
    made.close()


def busy_timeout_ms(store):
    with store.look() as connection:
        return connection.execute(text("PRAGMA busy_timeout")).scalar()


def test_who_waits_gets_the_lock_when_it_is_let_go_of(settings, other):
    patient = Store(settings, patience_s=60)
    release = threading.Timer(0.3, lambda: other.execute("COMMIT"))
    release.start()
    try:
        with patient.write() as session:
            session.execute(_WRITTEN)
            assert not other.in_transaction
        assert busy_timeout_ms(patient) == 60_000
    finally:
        release.join()
        patient.close()


def test_who_has_waited_in_vain_is_told_so_and_waits_as_long_the_next_time(store, other):
    for _ in range(2):
        with pytest.raises(OperationalError, match="locked"), store.write() as session:
            session.execute(_WRITTEN)
        assert busy_timeout_ms(store) == 300
    other.execute("COMMIT")
    with store.write() as session:
        session.execute(_WRITTEN)
    with store.look() as connection:
        assert connection.execute(text("SELECT count(*) FROM store_probes")).scalar() == 1


def test_what_is_no_lack_of_patience_is_told_at_once(store, other):
    other.execute("COMMIT")
    # Inside a transaction there is no other: no time makes it possible.
    with store.write() as session, pytest.raises(OperationalError, match="within a transaction"):
        store._backend.begin(session.connection(), None)
