"""Which workers are lost, by a clock that nobody sets; how often one that dies is started again."""

import time
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

import pytest
from sqlalchemy import text

from service.job_queue import queue_of
from service.store.engines.store import Store
from service.store.workers import WorkerRecord
from service.workers.context import RunningJobs
from service.workers.processes.children import pause_s
from service.workers.processes.workers import Watch, heartbeat, note_trouble, register_worker

LOST_S = 0.2


@pytest.fixture
def session(settings):
    with Store(settings).write() as session:
        register_worker(session, "one", 1)
        register_worker(session, "two", 2)
        session.flush()
        yield session


def test_a_worker_that_shows_no_sign_of_life_is_lost_and_named_once(session):
    first, second, queue = Watch(), Watch(), queue_of(session)
    assert not any(watch.take_lost(session, queue, LOST_S) for watch in (first, second))
    time.sleep(1.5 * LOST_S)
    assert heartbeat(session, "two", 2)
    assert first.take_lost(session, queue, LOST_S) == ["one"]
    session.flush()
    assert second.take_lost(session, queue, LOST_S) == []
    assert not heartbeat(session, "one", 1)  # its jobs are others' now: it has to end
    register_worker(session, "one", 11)
    session.flush()
    assert heartbeat(session, "one", 11)
    assert session.get(WorkerRecord, "one").starts == 2


def test_the_jobs_of_a_lost_worker_are_the_queues_again_in_the_same_transaction(session):
    """One that starts under its name right after it begins them, and they are not taken from it."""
    watch, queue = Watch(), queue_of(session)
    for name in ("one", "two"):
        queue.enqueue_estimate(session, name, datetime.now(UTC))
        begun = "UPDATE workflow_status SET status = 'PENDING', executor_id = :name"
        session.execute(text(f"{begun} WHERE deduplication_id = :name"), {"name": name})
    watch.take_lost(session, queue, LOST_S)
    time.sleep(1.5 * LOST_S)
    assert heartbeat(session, "two", 2)
    assert watch.take_lost(session, queue, LOST_S) == ["one"]
    jobs = dict(session.execute(text("SELECT deduplication_id, status FROM workflow_status")).all())
    assert jobs == {"one": "ENQUEUED", "two": "PENDING"}
    session.rollback()
    assert not session.execute(text("SELECT 1 FROM workflow_status")).all()


@pytest.mark.parametrize("hours", [1, -1])
def test_a_clock_that_jumps_makes_nobody_lost(session, hours):
    watch, lost_s = Watch(), 600.0  # longer than two questions take anywhere
    watch.take_lost(session, queue_of(session), lost_s)
    for name in ("one", "two"):  # what they wrote before the jump
        session.get(WorkerRecord, name).heartbeat_at = datetime.now(UTC) - timedelta(hours=hours)
    assert watch.take_lost(session, queue_of(session), lost_s) == []


def test_who_watches_anew_waits_anew(session):
    time.sleep(1.5 * LOST_S)
    assert Watch().take_lost(session, queue_of(session), LOST_S) == []


def test_a_worker_that_cannot_be_kept_alive_is_told(http, settings):
    with Store(settings).write() as session:
        note_trouble(session, "local-0", "died 5 times in a row: ended by signal 11")
    body = http.get("/readyz").json()
    assert "worker: local-0 died 5 times in a row: ended by signal 11" in body["problems"]
    assert not body["worker_alive"]
    with Store(settings).write() as session:
        register_worker(session, "local-0", 5)
        note_trouble(session, "local-0", None)
    assert http.get("/readyz").json()["problems"] == []


def test_restarts_are_counted(http, settings):
    for pid in (1, 2, 3):
        with Store(settings).write() as session:
            register_worker(session, "local-0", pid)
    assert 'surefoot_worker_restarts_total{worker="local-0"} 2.0' in http.get("/metrics").text


@pytest.mark.parametrize(
    ("deaths", "seconds"), [(1, 1), (2, 2), (3, 4), (6, 32), (7, 60), (1000, 60)]
)
def test_who_dies_again_and_again_is_started_ever_more_rarely(deaths, seconds):
    assert pause_s(deaths) == seconds


def test_a_task_beyond_its_limit_is_overdue(monkeypatch):
    clock = iter([0.0, 0.0, 60.0, 60.1])
    standing = SimpleNamespace(monotonic=lambda: next(clock))
    monkeypatch.setattr("service.workers.context.time", standing)
    running = RunningJobs(limits_s={"estimate": 60.0})
    with running.job("train", "a"), running.job("estimate", "corner"):
        assert running.overdue() is None
        assert running.overdue().about == ("corner",)
        assert running.of_kind("train") == 1
    monkeypatch.undo()
    assert running.overdue() is None
