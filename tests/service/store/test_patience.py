"""Writers of several processes on SQLite, who wait for one another as long as they are told."""

import sqlite3
import threading
from contextlib import closing

import pytest
from sqlalchemy import text
from sqlalchemy.exc import OperationalError

from service.alerts.staleness import StaleWatch
from service.job_queue import JobQueue
from service.store.engines.store import Store
from service.workers.context import JobContext
from service.workers.upkeep.reconciliation import run_reconcile
from service.workers.upkeep.retention import limits_of_camera
from tests.stores.databases import only_sqlite
from tests.stores.rows import put_rows, row_of

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


def test_what_hardly_ever_writes_waits_for_nobody_where_it_does_not(store, other):
    def count(session):
        return session.execute(text("SELECT count(*) FROM store_probes")).scalar()

    assert store.write_if_needed("corner", count) == 0
    assert other.in_transaction


def test_and_where_it_writes_it_is_done_again_in_its_turn(store, other):
    begun = []

    def write(session):
        begun.append(session.execute(text("SELECT count(*) FROM store_probes")).scalar())
        session.execute(_WRITTEN)
        return "written"

    with pytest.raises(OperationalError, match="locked"):
        store.write_if_needed("corner", write)
    other.execute("COMMIT")
    assert store.write_if_needed("corner", write) == "written"
    assert begun == [0, 0, 0]  # where the lock was not had, it was not begun
    with store.write() as session:  # by a connection that was only to look before
        session.execute(_WRITTEN)


def test_what_goes_wrong_while_looking_is_told_and_not_tried_again(store, other):
    tries = []

    def ask(session):
        tries.append(session)
        session.execute(text("SELECT 1 FROM nowhere"))

    with pytest.raises(OperationalError, match="no such table"):
        store.write_if_needed("corner", ask)
    assert len(tries) == 1


def test_upkeep_that_finds_nothing_to_do_waits_for_nobody(settings, store, other):
    other.execute("COMMIT")
    with store.change() as connection:
        put_rows(connection, "cameras", [row_of("cameras", id="corner")])
        put_rows(connection, "prior_poses", [row_of("prior_poses", camera_id="corner")])
    other.execute("BEGIN IMMEDIATE")
    context = JobContext(
        settings=settings.model_copy(update={"trainings": "off"}),
        store=store,
        queue=JobQueue(store.engine),
    )
    run_reconcile(context, StaleWatch())
    for limit in limits_of_camera(settings, "corner"):
        assert store.write_if_needed("corner", limit.bite) == 0, limit.name
