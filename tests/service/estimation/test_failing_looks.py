"""What fails beside the served estimate is said; a camera whose own fails is told as stale."""

import time
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import partial

import pytest
from sqlalchemy import text, update

from models.errors import CheckpointError
from service.alerts.staleness import StaleWatch
from service.estimate_queue import (
    cooldown_s,
    queue_overlooked,
    request_estimate,
)
from service.reasons import ServiceCode
from service.store import references, trainings
from service.store.cameras import CameraRecord
from service.store.references import FlowMapRecord, SiteReferenceRecord
from service.store.tracks import TrackRecord
from service.training import begin_training, publish_model
from service.workers.estimate import run_estimate
from service.workers.upkeep import reconciliation
from tests.conftest import CAMERA
from tests.service.street import KNOCKED, PRIOR, Street, known_street
from tests.stores.queued import queued_cameras

WANTED = 60


@pytest.fixture
def street(learned):
    """A camera whose reference is learned."""
    return learned("failing-looks", partial(known_street, people=WANTED))


@pytest.fixture
def newcomer(http, settings):
    """A camera whose reference is yet to be learned."""
    http.post("/cameras", json=CAMERA).raise_for_status()
    return Street(http, settings)


def change(street, **changes):
    settings = street.context.settings.model_copy(update=changes)
    street.context = replace(street.context, settings=settings)


def publish(street, digest="0" * 64):
    """A model whose weights are not there."""
    with street.context.store.write() as session:
        training = trainings.unfinished(session, "corner")[0]
        attempt = begin_training(session, street.context.settings, training.id)
        publish_model(session, street.context.queue, attempt, weights_sha256=digest, metrics={})


def camera(street):
    with street.context.store.read() as session:
        return session.get_one(CameraRecord, "corner")


def spoil(street, table, **values):
    with street.context.store.write() as session:
        session.execute(update(table).values(**values))


def watch(street, stale):
    with street.context.store.write() as session:
        return stale.watch(session, street.context.settings)


def let_rest_end(street):
    """As if the rest of the camera were over."""
    with street.context.store.write() as session:
        session.get_one(CameraRecord, "corner").estimate_after = None


@pytest.mark.parametrize("damage", ["missing", "truncated"])
def test_a_model_without_weights_blinds_nobody_and_is_trained_anew(street, damage):
    publish(street)
    folder = street.context.settings.weights_dir
    if damage == "truncated":
        folder.mkdir(exist_ok=True)
        (folder / ("0" * 64 + ".safetensors")).write_bytes(b"half of it")
    street.keep_to_lanes(PRIOR, 30)
    body = street.look()
    assert (body["state"], body["tracks"]) == ("ok", 30)
    assert "without the averaged estimate: the weights of its model" in body["reason"]
    (lack,) = camera(street).missing_parts
    assert (lack.code, lack.values["part"]) == (ServiceCode.WITHOUT_PART, "averaged estimate")
    with street.context.store.write() as session:
        found = reconciliation.reconcile_camera(
            session, street.context.queue, street.context.settings, "corner"
        )
    assert "camera without a model" in found
    street.keep_to_lanes(PRIOR, 5)
    street.look()
    assert camera(street).missing_parts == ()


@pytest.mark.parametrize("part", ["data", "chart"])
def test_a_map_or_chart_that_cannot_be_read_blinds_nobody(street, part):
    spoil(street, FlowMapRecord, **{part: b"not a map"})
    street.keep_to_lanes(KNOCKED, 40)
    body = street.look()
    assert body["drift"]["tilt_deg"] == pytest.approx(5.0, abs=1.5)
    assert (
        f"without the {'flow map' if part == 'data' else 'chart'}: cannot be read"
        in (body["reason"])
    )
    assert camera(street).estimate_failing_since is None


def test_a_map_that_cannot_grow_is_left_as_it_was(street):
    with street.context.store.read() as session:
        reference = references.newest(session, "corner")
        before = session.get(FlowMapRecord, reference.id).learned_at
    # Read by the growth alone: the pose does without.
    change(street, window_tracks=40, flow_unsure_tracks=5, flow_half_life_days="not a number")
    street.keep_to_lanes(PRIOR, 100)
    body = street.look()
    assert (body["state"], body["tracks"]) == ("ok", 40)
    (lack,) = camera(street).missing_parts
    assert lack.values["part"] == "growth_of_the_flow_map"
    page = " ".join(street.http.get("/ui/cameras/corner").text.split())
    assert "Without the growth of the flow map" in page
    street.keep_to_lanes(PRIOR, 5)  # it rests for an hour; what is lacking is not forgotten
    street.look()
    assert camera(street).missing_parts == (lack,)
    with street.context.store.read() as session:
        assert session.get(FlowMapRecord, reference.id).learned_at == before


def test_a_camera_whose_looks_fail_rests_longer_each_time_and_is_told(street):
    spoil(street, SiteReferenceRecord, data=b"not a reference")
    street.keep_to_lanes(PRIOR, 30)
    stale = StaleWatch()
    rests = []
    for _ in range(3):
        assert street.alerts() == []
        let_rest_end(street)
        begun = datetime.now(UTC)
        with pytest.raises(CheckpointError):
            run_estimate(street.context, "corner")
        rests.append((camera(street).estimate_after - begun).total_seconds())
        watch(street, stale)
    assert rests == pytest.approx([5, 10, 20], abs=3)
    (alert,) = street.alerts()
    assert (alert["kind"], alert["severity"], alert["state"]) == ("stale", "critical", "firing")
    assert "3 tries failed in a row" in alert["reason"]
    page = street.http.get("/ui/cameras/corner").text
    assert "Its estimate fails or lacks tracks" in page
    assert "its estimate fails or lacks tracks" in street.http.get("/").text
    text = street.http.get("/metrics").text
    assert 'surefoot_camera_estimate_failing{camera_id="corner"} 1.0' in text
    assert "surefoot_cameras_failing 1.0" in text
    ready = street.http.get("/readyz").json()
    assert ready["failing_cameras"] == 1
    assert any("CheckpointError" in problem for problem in ready["problems"])


def test_a_stale_camera_is_told_though_somebody_is_at_it(newcomer):
    now = datetime.now(UTC)
    body = {"from": now.isoformat(), "to": (now + timedelta(hours=1)).isoformat()}
    newcomer.http.post("/cameras/corner/maintenance", json=body).raise_for_status()
    spoil(newcomer, CameraRecord, estimate_tries=3, estimate_error="x",
          estimate_failing_since=now, estimate_due_at=now)  # fmt: skip
    assert watch(newcomer, StaleWatch()) == {"corner": "opened"}
    assert newcomer.alerts()[0]["kind"] == "stale"


def test_an_alert_ends_by_itself_and_one_that_was_answered_stays_away(newcomer):
    stale = StaleWatch()
    newcomer.keep_to_lanes(PRIOR, 30)
    spoil(newcomer, CameraRecord, estimate_tries=3, estimate_error="x",
          estimate_failing_since=datetime.now(UTC), estimate_after=None)  # fmt: skip
    assert watch(newcomer, stale) == {"corner": "opened"}
    (alert,) = newcomer.alerts()
    answer = {"outcome": "false_alarm", "by": "Ann"}
    newcomer.http.post(f"/alerts/{alert['id']}/resolve", json=answer).raise_for_status()
    assert watch(newcomer, stale) == {}
    spoil(newcomer, CameraRecord, estimate_tries=0)
    newcomer.look()
    spoil(newcomer, CameraRecord, estimate_tries=3, estimate_error="x",
          estimate_due_at=datetime.now(UTC))  # fmt: skip
    assert len(newcomer.alerts()) == 1  # the answer of a moment ago still holds


def test_tracks_that_wait_for_long_are_told_by_their_true_age_until_they_are_seen(newcomer):
    # The clock of the watch is its own: tracks that were received long ago have not waited for it.
    change(newcomer, stale_after_s=0.3)
    stale = StaleWatch()
    newcomer.keep_to_lanes(PRIOR, 30)
    long_ago = datetime.now(UTC) - timedelta(minutes=20)
    spoil(newcomer, TrackRecord, received_at=long_ago)
    assert watch(newcomer, stale) == {}
    lag_s = newcomer.http.get("/readyz").json()["queue_lag_s"]
    assert lag_s == pytest.approx(1200, abs=60)
    assert "queue: tracks wait for" in " ".join(newcomer.http.get("/readyz").json()["problems"])
    time.sleep(0.4)
    assert watch(newcomer, stale) == {"corner": "opened"}
    newcomer.look()
    assert watch(newcomer, stale) == {"corner": "ended"}
    assert newcomer.alerts()[0]["outcome"] == "cleared"
    assert newcomer.http.get("/readyz").json()["queue_lag_s"] == 0


def test_a_camera_that_workers_die_of_is_left_alone_for_a_while(newcomer):
    newcomer.keep_to_lanes(PRIOR, 30)
    spoil(newcomer, CameraRecord, estimate_tries=2, estimate_error=None, estimate_due_at=None,
          estimate_after=datetime.now(UTC) + timedelta(seconds=cooldown_s(2)))  # fmt: skip
    run_estimate(newcomer.context, "corner")  # the engine runs it again at once
    assert camera(newcomer).read_track_pk != 90
    assert "died" in camera(newcomer).estimate_error
    assert camera(newcomer).estimate_due_at is not None
    # The clock was set back by a day: what lies that far ahead is waited for no longer.
    spoil(newcomer, CameraRecord, estimate_after=datetime.now(UTC) + timedelta(days=1))
    assert newcomer.look()["tracks"] == 30


def test_one_job_a_camera_however_often_it_is_asked_for(newcomer):
    newcomer.keep_to_lanes(PRIOR, 5)
    context = newcomer.context
    for _ in range(5):
        spoil(newcomer, CameraRecord, estimate_due_at=None)
        with context.store.write() as session:
            request_estimate(session, context.queue, "corner")
            reconciliation.reconcile_camera(session, context.queue, context.settings, "corner")
    with context.store.read() as session:
        assert queued_cameras(session) == ["corner"]
        assert queue_overlooked(session, context.queue) == []


def test_a_job_that_the_engine_lost_is_found_and_what_is_due_keeps_its_age(newcomer):
    newcomer.keep_to_lanes(PRIOR, 5)
    context = newcomer.context
    due_at = camera(newcomer).estimate_due_at
    with context.store.write() as session:
        session.execute(text("DELETE FROM workflow_status"))
    with context.store.write() as session:
        assert queue_overlooked(session, context.queue) == ["corner"]
    assert camera(newcomer).estimate_due_at == due_at
    with context.store.read() as session:
        assert queued_cameras(session) == ["corner"]
        assert queue_overlooked(session, context.queue) == []


def test_a_camera_rests_after_a_look_and_is_asked_for_once_it_has(newcomer):
    context = newcomer.context
    with context.store.write() as session:
        session.get_one(CameraRecord, "corner").estimate_after = datetime.now(UTC) + timedelta(
            seconds=30
        )
        session.execute(text("DELETE FROM workflow_status"))
    newcomer.keep_to_lanes(PRIOR, 5)
    with context.store.read() as session:
        assert queued_cameras(session) == []
        assert queue_overlooked(session, context.queue) == []
    let_rest_end(newcomer)
    with context.store.write() as session:
        assert queue_overlooked(session, context.queue) == ["corner"]


def test_a_training_that_the_engine_lost_is_queued_again_and_at_last_fails(newcomer):
    context = newcomer.context

    def reconcile():
        with context.store.write() as session:
            return reconciliation.reconcile_camera(
                session, context.queue, context.settings, "corner"
            )

    def training():
        return newcomer.http.get("/cameras/corner/trainings").json()["items"][0]

    assert reconcile() == []  # its job waits
    spoil_jobs = text("UPDATE workflow_status SET status = 'ERROR' WHERE name = 'train'")
    with context.store.write() as session:
        session.execute(spoil_jobs)
    assert reconcile() == ["training without a job"]
    assert reconcile() == []
    with context.store.write() as session:
        session.execute(spoil_jobs)
        session.execute(text("UPDATE trainings SET attempt = 10"))
    assert reconcile() == ["training without a job"]
    assert training()["state"] == "failed"
    assert "10 attempts" in training()["error"]
    assert reconcile() == []
