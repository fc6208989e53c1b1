"""Runs, CPU seconds and age of results in `/metrics`, from the worker to the scrape."""

import os
import threading
from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import update

from models.errors import TooFewTrajectoriesError
from service.commands import worker
from service.enums import RunKind
from service.errors import StorageFullError
from service.job_queue import JobQueue
from service.operations.result_ages import result_ages
from service.store import runs, tracks
from service.store.cameras import CameraRecord
from service.store.estimates import EstimateRecord
from service.store.runs import RunTotal
from service.store.tracks import TrackRecord
from service.workers import estimate
from service.workers.context import JobContext, RunCounts
from service.workers.processes.workers import register_worker
from tests.conftest import track
from tests.service.operations.test_metrics import scrape, value
from tests.service.street import PRIOR, known_street

RUNS, CPU_S = "surefoot_estimation_runs_total", "surefoot_estimation_cpu_seconds_total"


def test_metrics_of_an_empty_service_have_no_runs_and_no_ages(http):
    found = scrape(http)
    for kind in ("monitor", "full"):
        assert value(found, RUNS, kind=kind) == 0
        assert value(found, CPU_S, kind=kind) == 0
    assert not [key for key in found if key[0] == "surefoot_result_age_seconds"]


def test_metrics_have_the_stored_runs_by_kind(http, store):
    with store.write() as session:
        found = {
            RunKind.MONITOR: RunTotal(runs=40, cpu_s=0.24),
            RunKind.FULL: RunTotal(runs=2, cpu_s=0.5),
        }
        runs.add(session, found, datetime.now(UTC))
    scraped = scrape(http)
    assert value(scraped, RUNS, kind="monitor") == 40
    assert value(scraped, CPU_S, kind="monitor") == pytest.approx(0.24)
    assert value(scraped, RUNS, kind="full") == 2
    assert value(scraped, CPU_S, kind="full") == pytest.approx(0.5)


@pytest.fixture
def street(http, settings):
    made = known_street(http, settings, 60)
    made.context.runs.take()
    yield made
    made.close()


def test_a_run_with_few_new_tracks_is_counted_as_monitor(street):
    street.keep_to_lanes(PRIOR, 60)
    street.look()
    street.context.runs.take()
    street.keep_to_lanes(PRIOR, 2)
    street.look()
    found = street.context.runs.take()
    assert found.keys() == {RunKind.MONITOR}
    assert found[RunKind.MONITOR].runs == 1
    assert 0 < found[RunKind.MONITOR].cpu_s < 5
    street.look(full=True)
    assert street.context.runs.take()[RunKind.FULL].runs == 1


def test_a_run_that_fails_is_counted_with_its_cpu_time(street, monkeypatch):
    def fail(*_args, **_named):
        raise TooFewTrajectoriesError("tracks: at least 5 are needed, got 0")

    monkeypatch.setattr(estimate, "_look", fail)
    with pytest.raises(TooFewTrajectoriesError):
        estimate.run_estimate(street.context, "corner")
    assert street.context.runs.take()[RunKind.FULL].runs == 1


def test_run_counts_are_taken_once():
    counts = RunCounts()
    counts.add(RunKind.FULL, RunTotal(runs=1, cpu_s=0.1))
    counts.add(RunKind.FULL, RunTotal(runs=1, cpu_s=0.2))
    assert counts.take() == {RunKind.FULL: RunTotal(runs=2, cpu_s=pytest.approx(0.3))}
    assert counts.take() == {}


@pytest.fixture
def checked(corner, store):
    """A camera whose newest track arrived 60 s ago and was checked 4 s later."""
    now = datetime.now(UTC)
    corner.post("/cameras/corner/tracks", json={"tracks": [track("1")]}).raise_for_status()
    with store.write() as session:
        session.execute(update(TrackRecord).values(received_at=now - timedelta(seconds=60)))
        camera = session.get(CameraRecord, "corner")
        camera.read_track_pk = session.query(TrackRecord.id).scalar()
        camera.checked_at = now - timedelta(seconds=56)
    return now


def test_age_of_monitoring_is_from_the_newest_track_to_its_check(checked, store):
    with store.read() as session:
        found = result_ages(session, tracks.unseen_since(session), checked)
    assert found[RunKind.MONITOR].median_s == pytest.approx(4.0)
    assert found[RunKind.MONITOR].worst_s == pytest.approx(4.0)
    assert RunKind.FULL not in found


def test_age_of_monitoring_grows_while_a_track_waits(checked, corner, store):
    corner.post("/cameras/corner/tracks", json={"tracks": [track("2")]}).raise_for_status()
    with store.read() as session:
        waiting = tracks.unseen_since(session)
        found = result_ages(session, waiting, datetime.now(UTC) + timedelta(seconds=30))
    assert found[RunKind.MONITOR].worst_s == pytest.approx(30.0, abs=5.0)


def test_age_of_the_full_estimate_is_to_the_newest_track(bench):
    bench.see(PRIOR)
    with bench.store.write() as session:
        made_at = session.query(EstimateRecord.created_at).scalar()
        session.execute(update(TrackRecord).values(received_at=made_at + timedelta(seconds=75)))
    found = scrape(bench.http)
    for statistic in ("median", "p95", "max"):
        labels = {"kind": "full", "statistic": statistic}
        assert value(found, "surefoot_result_age_seconds", **labels) == pytest.approx(75.0)


@pytest.fixture
def context(settings, store, monkeypatch):
    """A worker that ends after a few heartbeats and has made a monitor run."""
    monkeypatch.setattr(worker, "BEAT_S", 0.02)
    with store.write() as session:
        register_worker(session, "one", os.getpid())
    context = JobContext(settings=settings, store=store, queue=JobQueue(store.engine))
    context.runs.add(RunKind.MONITOR, RunTotal(runs=3, cpu_s=0.02))
    timer = threading.Timer(0.5, context.stopping.set)
    timer.start()
    yield context
    timer.join()
    context.queue.close()


def test_heartbeat_stores_the_runs_of_a_worker_once(context, http):
    assert worker._mind(context, "one") == 0
    found = scrape(http)
    assert value(found, RUNS, kind="monitor") == 3
    assert value(found, CPU_S, kind="monitor") == pytest.approx(0.02)


def test_heartbeat_that_cannot_be_stored_keeps_the_runs(context, http, monkeypatch):
    def fail(*_args):
        raise StorageFullError("the disk is full")

    monkeypatch.setattr(worker, "heartbeat", fail)
    assert worker._mind(context, "one") == 0
    assert value(scrape(http), RUNS, kind="monitor") == 0
    assert context.runs.take() == {RunKind.MONITOR: RunTotal(runs=3, cpu_s=0.02)}
