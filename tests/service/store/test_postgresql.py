"""What is PostgreSQL's own: who writes beside whom, order of what is followed, refusals."""

import hashlib
import socket
import threading
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from sqlalchemy import text
from sqlalchemy.exc import DBAPIError

from service.commands.migrate import migrate
from service.data_dir import StartError
from service.enums import EventType
from service.errors import OverloadedError, StoreUnavailableError
from service.job_queue import JobQueue
from service.setting_values import read_database_url
from service.store import journal, trainings
from service.store.engines.dialects import now_in
from service.store.engines.failures import failure_of
from service.store.engines.store import Store
from service.store.workers import WorkerRecord
from service.training import fetch_weights, share_weights
from service.workers.processes.workers import (
    heartbeat,
    register_worker,
    take_setback,
    worker_name,
)
from tests.stores import server
from tests.stores.queued import queued_cameras

pytestmark = pytest.mark.skipif(not server.wanted(), reason="PostgreSQL only")


@pytest.fixture
def store(settings):
    made = Store(settings, patience_s=0.3)
    yield made
    made.close()


def add(session, said):
    journal.add_event(session, EventType.POSE, {"said": said}, datetime.now(UTC))
    session.flush()


def said_after(store, seen=0):
    with store.read() as session:
        return [event.payload["said"] for event in journal.events_after(session, seen, 100)]


def test_nobody_reads_beyond_what_may_still_come_before(store):
    with store.write("a") as first:
        add(first, "first")
        with store.write("b") as second:
            add(second, "second")
        assert said_after(store) == []  # its id is larger than one that may be committed yet
        with store.read() as reading:
            begun = journal.newest_event_id(reading)
    assert said_after(store) == said_after(store, begun) == ["first", "second"]


def test_what_is_rolled_back_holds_up_nobody(store):
    with store.write("a") as first:
        add(first, "never")
        first.rollback()
    with store.write("b") as second:
        add(second, "then")
    assert said_after(store) == ["then"]


def test_a_hundred_writers_are_followed_without_a_gap(store):
    """Whoever reads on from the last id sees every event once, in the order of the ids."""
    done, seen, said = threading.Event(), 0, []

    def write(number):
        for each in range(25):
            with store.write(f"c{number}") as session:
                add(session, f"{number}-{each}")

    threads = [threading.Thread(target=write, args=(number,)) for number in range(4)]
    waiter = threading.Thread(target=lambda: ([t.join() for t in threads], done.set()))
    for thread in [*threads, waiter]:
        thread.start()
    ended = False
    while not ended:
        ended = done.is_set()
        with store.read() as session:
            for event in journal.events_after(session, seen, 1000):
                seen = event.id
                said.append(event.payload["said"])
    assert sorted(said) == sorted(f"{number}-{each}" for number in range(4) for each in range(25))
    for number in range(4):  # those about one thing in the order in which they were committed
        own = [one for one in said if one.startswith(f"{number}-")]
        assert own == [f"{number}-{each}" for each in range(25)]


def test_one_thing_is_written_by_one_and_others_meanwhile(store):
    with store.write("a"), store.write("b"), store.change("c"):
        pass
    for held, wanted in (("a", "a"), ("a", None), (None, "a"), (None, None)):
        with store.write(held):
            with pytest.raises(DBAPIError) as raised, store.write(wanted):
                pass
            assert isinstance(failure_of(raised.value), OverloadedError)


def test_a_job_that_is_there_takes_nothing_with_it(store):
    queue = JobQueue(store.engine)
    for said in ("first", "second"):
        with store.write("corner") as session:
            add(session, said)
            queue.enqueue_estimate(session, "corner", datetime.now(UTC))
    with store.read() as session:
        assert queued_cameras(session) == ["corner"]
    assert said_after(store) == ["first", "second"]


def test_a_server_that_is_gone_is_told_of_and_its_password_is_not(settings):
    nowhere = settings.model_copy(
        update={"database_url": read_database_url("postgresql://ada:hush@127.0.0.1:1/surefoot")}
    )
    with pytest.raises(StartError, match="database: .*127.0.0.1:1/surefoot cannot be") as raised:
        migrate(nowhere)
    assert "hush" not in str(raised.value)
    with pytest.raises(DBAPIError) as cut, Store(nowhere, patience_s=0.3).write():
        pass
    assert isinstance(failure_of(cut.value), StoreUnavailableError)


def test_connections_that_the_server_has_closed_are_made_anew(settings, store):
    with store.write("a") as session:
        add(session, "before")
    others = "pid <> pg_backend_pid() AND datname = current_database()"
    with Store(settings).read() as session:
        session.execute(
            text(f"SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE {others}")
        )
    time.sleep(1.1)  # a connection that was used a moment ago is not tried before it is used
    assert said_after(store) == ["before"]


def test_a_newer_schema_is_not_touched(settings, store):
    with store.write() as session:
        session.execute(text("UPDATE alembic_version SET version_num = '2099_01_01_newer'"))
    with pytest.raises(StartError, match="schema: the database is of revision 2099_01_01_newer"):
        migrate(settings)


def test_many_that_migrate_at_once_make_one_schema(settings, store):
    with store.engine.begin() as connection:
        connection.execute(text("DROP SCHEMA public CASCADE"))
        connection.execute(text("CREATE SCHEMA public"))
        connection.execute(text("DROP SCHEMA dbos CASCADE"))
    failures = []

    def run():
        try:
            migrate(settings)
        except Exception as error:
            failures.append(error)

    threads = [threading.Thread(target=run) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert failures == []
    with store.write("a") as session:
        add(session, "works")
    assert said_after(store) == ["works"]


def test_a_lock_is_one_holders_and_goes_with_its_connection(store):
    first, second = store.lock("rounds"), store.lock("rounds")
    assert first.held()
    assert first.held()
    assert not second.held()
    first.close()
    assert second.held()
    third = store.lock("rounds")
    assert not third.held()
    second.close()
    assert third.held()
    third.close()


def test_weights_of_another_machine_are_fetched_once(settings, store, tmp_path):
    data = b"weights of a model"
    sha256 = hashlib.sha256(data).hexdigest()
    settings.weights_dir.mkdir(exist_ok=True)
    (settings.weights_dir / f"{sha256}.safetensors").write_bytes(data)
    for _ in range(2):
        with store.write() as session:
            share_weights(session, settings, sha256)
    elsewhere = settings.model_copy(update={"data_dir": tmp_path / "elsewhere"})
    fetch_weights(store, elsewhere, sha256)
    fetch_weights(store, elsewhere, "0" * 64)
    assert [path.read_bytes() for path in elsewhere.weights_dir.iterdir()] == [data]
    with store.write() as session:  # no model names them
        assert trainings.forget_weights(session, 10) == 1


def test_workers_are_heard_of_by_the_servers_clock(store, monkeypatch):
    with store.write() as session:
        register_worker(session, "a", 1)
    with store.read() as session:
        begun = session.get(WorkerRecord, "a").heartbeat_at
        assert abs((now_in(session) - begun).total_seconds()) < 5
    with monkeypatch.context() as patched, store.write() as session:
        patched.setattr(
            "service.store.engines.dialects.datetime", None
        )  # this machine's says nothing
        assert heartbeat(session, "a", 1)
        assert take_setback(session) <= timedelta()


def test_a_workers_name_has_its_machine_in_it(settings):
    name = worker_name(settings, "local-0")
    assert name.startswith(f"local-0@{socket.gethostname()}-")
    assert name != worker_name(settings.model_copy(update={"data_dir": Path("b")}), "local-0")
    assert worker_name(settings, "a@b") == "a@b"
    on_file = settings.model_copy(update={"database_url": None})
    assert worker_name(on_file, "local-0") == "local-0"
