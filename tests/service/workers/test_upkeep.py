"""What the reconcile finds in the store."""

import time
from dataclasses import replace

import pytest
from sqlalchemy import event

from models.geometry.pose import CameraPose
from service.cameras.cameras import add_prior_pose
from service.cameras.tracks import receive_tracks
from service.estimate_queue import finish_run, request_estimate, start_run
from service.formats.json_track import read_track
from service.formats.track import Batch, Clock, Limits
from service.store import cameras, tracks, trainings, windows
from service.store.cameras import CameraRecord
from service.store.engines.store import Store
from service.store.trainings import TrainingRecord
from service.store.windows import WindowBounds
from service.training import (
    StepWatch,
    begin_training,
    cancel_training,
    end_training,
    publish_model,
    report_progress,
)
from service.workers.upkeep import reconciliation
from tests.conftest import track


class Recorder:
    """A job queue that notes what it was asked for."""

    def __init__(self):
        self.trainings, self.estimates = [], []

    def enqueue_training(self, session, camera_id, training_id):
        self.trainings.append(training_id)

    def requeue_training(self, session, camera_id, training_id):
        return False

    def enqueue_estimate(self, session, camera_id, due_at, *, urgent=False):
        self.estimates.append(camera_id)


@pytest.fixture
def queue():
    return Recorder()


@pytest.fixture
def session(corner, settings):
    with Store(settings).write() as session:
        yield session


def begin(session, settings):
    return begin_training(session, settings, trainings.unfinished(session, "corner")[0].id)


def publish(session, queue, settings):
    attempt = begin(session, settings)
    publish_model(session, queue, attempt, weights_sha256="0" * 64, metrics={})
    return trainings.newest_model(session, "corner")


def put_tracks(session, count, *, step_s=0.4, start_s=None, first=0):
    start_s = time.time() - 3600 if start_s is None else start_s
    batch = []
    for n in range(first, first + count):
        raw = track(str(n), start_s=start_s + n)
        for k, point in enumerate(raw["points"]):
            point[0] = start_s + n + step_s * k
        clock = Clock(frame_rate_hz=None, started_at_s=None)
        limits = Limits(width=1280, height=720, now_s=time.time(), max_ahead_s=60.0)
        batch.append(read_track(raw, "t", clock, limits))
    return receive_tracks(
        session.connection(),
        Recorder(),
        "corner",
        Batch(source="t", tracks=tuple(batch), rejections=()),
        read_by=cameras.awaited(session.connection(), "corner").picture,
    )


def test_a_training_under_way_is_left_alone(session, queue, settings):
    assert reconciliation.reconcile_camera(session, queue, settings, "corner") == []


def test_a_camera_without_a_model_is_trained(session, queue, settings):
    session.delete(trainings.unfinished(session, "corner")[0])
    session.flush()
    found = reconciliation.reconcile_camera(session, queue, settings, "corner")
    assert found == ["camera without a model"]
    assert len(queue.trainings) == 1


def test_where_trainings_are_off_none_is_missing(session, queue, settings):
    session.delete(trainings.unfinished(session, "corner")[0])
    session.flush()
    off = settings.model_copy(update={"trainings": "off"})
    assert reconciliation.reconcile_camera(session, queue, off, "corner") == []
    assert queue.trainings == []


def test_of_a_camera_that_needs_nothing_little_is_asked(session, queue, settings):
    """Each of hundreds is asked of once a minute, by night too."""
    session.delete(trainings.unfinished(session, "corner")[0])
    put_tracks(session, 2)  # an hour ago: a silence, but not as long as the limit
    finish_run(session, "corner", tracks.newest_pk(session, "corner"), rest_s=0.0, failures=())
    session.flush()
    asked = []
    connection = session.connection()
    event.listen(connection, "before_cursor_execute", lambda *said: asked.append(said[2]))
    off = settings.model_copy(update={"trainings": "off"})
    assert reconciliation.reconcile_camera(session, queue, off, "corner") == []
    assert 0 < len(asked) <= 9, asked


@pytest.mark.parametrize("state", ["failed", "cancelled"])
def test_what_failed_or_was_cancelled_is_not_tried_again_by_itself(session, queue, settings, state):
    end_training(session, begin(session, settings), state)
    assert reconciliation.reconcile_camera(session, queue, settings, "corner") == []


def test_a_model_older_than_the_prior_pose_is_replaced_and_used_meanwhile(session, queue, settings):
    model = publish(session, queue, settings)
    add_prior_pose(session, "corner", CameraPose(height_m=5, tilt_rad=0.3), "changed", None)
    found = reconciliation.reconcile_camera(session, queue, settings, "corner")
    assert found == ["model older than the prior pose"]
    assert trainings.newest_model(session, "corner").id == model.id


def test_tracks_that_nothing_has_looked_at_are_looked_at(session, queue, settings):
    put_tracks(session, 5)
    camera = session.get_one(CameraRecord, "corner")
    camera.estimate_due_at = None  # the nudge of the post was lost
    found = reconciliation.reconcile_camera(session, queue, settings, "corner")
    assert found == ["tracks that nothing has looked at"]
    assert queue.estimates == ["corner"]
    assert reconciliation.reconcile_camera(session, queue, settings, "corner") == []
    finish_run(session, "corner", start_run(session, "corner")[0])
    session.expire(camera)  # the end of a run is written past the record
    assert reconciliation.reconcile_camera(session, queue, settings, "corner") == []


def test_tracks_that_the_model_in_use_has_not_looked_at_are_looked_at(session, queue, settings):
    put_tracks(session, 5)
    publish(session, queue, settings)
    finish_run(session, "corner", start_run(session, "corner")[0])  # by an older model, or none
    queue.estimates.clear()
    found = reconciliation.reconcile_camera(session, queue, settings, "corner")
    assert found == ["tracks that nothing has looked at"]
    assert queue.estimates == ["corner"]


def test_many_posts_ask_for_one_estimate(session, queue, settings):
    publish(session, queue, settings)
    assert queue.estimates == ["corner"]
    for _ in range(10):
        request_estimate(session, queue, "corner")
    assert queue.estimates == ["corner"]


def test_tracks_of_another_step_ask_for_another_model(session, queue, settings):
    model = publish(session, queue, settings)
    assert model.step_s == 0.4
    put_tracks(session, 30, step_s=0.4)
    assert reconciliation.reconcile_camera(session, queue, settings, "corner") == []
    put_tracks(session, 200, step_s=1.0, first=100)
    found = reconciliation.reconcile_camera(session, queue, settings, "corner")
    assert found == ["model of another sampling step than the tracks offer"]
    assert begin(session, settings).plan.walk.step_s == 1.0


def test_steps_that_suit_are_remembered_for_ten_minutes_and_others_asked_anew(
    session, queue, settings, monkeypatch
):
    now_s, watch = 1000.0, StepWatch()
    monkeypatch.setattr("time.monotonic", lambda: now_s)
    publish(session, queue, settings)
    put_tracks(session, 30, step_s=0.4)

    def found():
        return reconciliation.reconcile_camera(session, queue, settings, "corner", watch)

    assert found() == []
    put_tracks(session, 200, step_s=1.0, first=100)
    now_s += 599.0
    assert found() == []
    now_s += 1.0
    assert found() == ["model of another sampling step than the tracks offer"]
    put_tracks(session, 200, step_s=0.4, first=400)
    assert found() == []


def test_progress_of_an_attempt_that_was_taken_over_ends_it(session, settings):
    first = begin(session, settings)
    assert report_progress(session, first, 1, 10, 0.5, 9.0)
    second = begin(session, settings)  # the engine runs the job again after a crash
    assert second.attempt == 2
    assert not report_progress(session, first, 2, 10, 0.5, 8.0)
    publish_model(session, Recorder(), first, weights_sha256="1" * 64, metrics={})
    assert trainings.newest_model(session, "corner") is None
    publish_model(session, Recorder(), second, weights_sha256="2" * 64, metrics={})
    assert trainings.newest_model(session, "corner").weights_sha256 == "2" * 64
    assert begin_training(session, settings, first.training_id) is None


def test_a_cancelled_training_publishes_nothing(session, settings):
    attempt = begin(session, settings)
    cancel_training(session, attempt.training_id)
    assert not report_progress(session, attempt, 1, 10, 0.5, 9.0)
    publish_model(session, Recorder(), attempt, weights_sha256="1" * 64, metrics={})
    assert session.get(TrainingRecord, attempt.training_id).state == "cancelled"
    assert trainings.newest_model(session, "corner") is None


def test_the_window_is_the_newest_tracks_by_their_own_times(session):
    now = time.time()
    put_tracks(session, 5, start_s=now - 20 * 86_400)
    put_tracks(session, 6, start_s=now - 3600, first=50)
    window = windows.window(session, WindowBounds(camera_id="corner", tracks=400, days=7.0))
    assert len(window) == 6
    assert window[-1].ended_s - window[0].started_s == pytest.approx(5 + 0.4 * 19)
    newest = windows.window(session, WindowBounds(camera_id="corner", tracks=4, days=7.0))
    assert [record.track_id for record in newest] == ["52", "53", "54", "55"]


def test_the_window_leaves_out_what_is_before_its_bounds(session):
    start_s = 1_700_000_000.0
    put_tracks(session, 10, start_s=start_s)  # one second apart, each 7.6 s long
    bounds = WindowBounds(camera_id="corner", tracks=400, days=7.0)
    for change, first in (
        ({"started_from_s": start_s + 3}, "3"),
        ({"ended_after_s": start_s + 3 + 7.6}, "4"),
        ({"ended_from_s": start_s + 3 + 7.6}, "3"),
    ):
        assert windows.window(session, replace(bounds, **change))[0].track_id == first
