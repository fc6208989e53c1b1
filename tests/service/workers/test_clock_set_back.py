"""A service that runs while its clock is an hour or a day ahead, and is set back."""

import time
from datetime import UTC, datetime, timedelta

import pytest
from fastapi.testclient import TestClient

from service.access import tokens
from service.access.sessions import caller_of_session, check_login, log_in
from service.access.tokens import TokenSpec
from service.alerts.data_gaps import watch_data_gap
from service.alerts.escalation import escalate
from service.alerts.staleness import StaleWatch
from service.app import create_app
from service.cameras.sources import watch_sources
from service.estimate_queue import request_estimate
from service.job_queue import JobQueue
from service.store import estimates, references, sources, tracks
from service.store.record import Record, UtcDateTime
from service.store.references import MaintenanceRecord
from service.workers.context import JobContext
from service.workers.upkeep.periodic import ClockWatch
from service.workers.upkeep.reconciliation import run_reconcile
from service.workers.upkeep.retention import run_retention
from tests.conftest import CAMERA, track
from tests.service.bench import PRIOR, Bench, moved
from tests.service.shifted_clock import ShiftedClock
from tests.stores.databases import ask


class Site:
    """The camera `corner` of a service whose clock is ahead until `set_back` is called."""

    def __init__(self, http, settings, clock, back):
        self.http, self.settings, self.clock, self.back = http, settings, clock, back
        self.bench = Bench(http, settings.model_copy(update={"window_tracks": 20}))
        self.store = self.bench.store
        self.context = JobContext(
            settings=settings, store=self.store, queue=JobQueue(self.store.engine)
        )
        self._watch = ClockWatch()

    def set_back(self):
        """What happens within a second of a clock that is set right."""
        self.clock.ahead = timedelta()
        self._watch.look(self.context)

    def later(self, **by):
        self.clock.ahead = timedelta(**by)

    def post(self, source="bytetrack"):
        started_s = self.clock.now_s() - self.clock.ahead.total_seconds() - 60  # the tracker's
        body = {"source": source, "tracks": [track(str(started_s), started_s)]}
        self.http.post("/cameras/corner/tracks", json=body).raise_for_status()

    def ground(self):
        """The place at the image's centre by the pose that holds now."""
        at = datetime.now(UTC) + self.clock.ahead
        body = {"points": [[639.5, 359.5]], "at": at.isoformat()}
        answer = self.http.post("/cameras/corner/ground", json=body).raise_for_status().json()
        return round(answer["points"][0]["y_m"], 1)

    def firing(self):
        items = self.http.get("/alerts", params={"state": "firing"}).json()["items"]
        return [alert["kind"] for alert in items]


@pytest.fixture(params=[1, 24], ids=["an hour", "a day"])
def site(request, settings):
    back = timedelta(hours=request.param)
    with ShiftedClock() as clock, TestClient(create_app(settings)) as http:
        clock.ahead = back
        http.post("/cameras", json=CAMERA).raise_for_status()
        made = Site(http, settings, clock, back)
        yield made
        made.context.queue.close()
        made.store.close()


def test_move_after_the_setback_is_detected_and_answered(site):
    site.bench.see(PRIOR)
    site.set_back()
    for _ in range(3):
        site.bench.see(moved(tilt_deg=8.0))
    assert site.firing() == ["drift"]
    assert site.bench.pose()["state"] == "drifting"
    site.http.post("/cameras/corner/pose/put-back").raise_for_status()
    for _ in range(2):
        site.bench.see(PRIOR)
    assert (site.firing(), site.bench.pose()["state"]) == ([], "ok")


def test_move_is_detected_after_the_trackers_clock_is_set_back_too(site):
    """No later track counted: a turn of 8 deg was `ok` for as long as the clocks had jumped."""
    back_s = site.back.total_seconds()
    site.bench.clock_s = site.clock.now_s() - 300  # of people who walk now, by a clock like ours
    site.bench.learn()
    site.bench.see(PRIOR)
    with site.store.read() as session:
        before = [(each.track_id, each.ended_s) for each in tracks.by_end(session)]
    site.bench.clock_s -= back_s
    site.set_back()
    with site.store.read() as session:
        stored = tracks.by_end(session)
        assert [(each.track_id, each.ended_s + back_s) for each in stored] == before
        for each in stored:
            ends_s = tracks.trajectory_of(each).time_s[[0, -1]]
            assert tuple(ends_s) == (each.started_s, each.ended_s)
    assert site.bench.pose()["state"] == "ok"
    for _ in range(3):
        site.bench.see(moved(tilt_deg=8.0))
    assert site.firing() == ["drift"]
    assert site.bench.pose()["drift"]["tilt_deg"] == pytest.approx(8.0, abs=0.1)


def test_track_whose_times_are_taken_does_not_keep_others_in_the_future(site):
    """The tracker posted one name at two times that lie as far apart as the clock jumps."""
    back_s = round(site.back.total_seconds())
    at_s = time.time() - 600
    batch = [track("1", at_s), track("1", at_s + back_s), track("2", at_s + back_s)]
    site.http.post("/cameras/corner/tracks", json={"tracks": batch}).raise_for_status()
    site.set_back()
    with site.store.read() as session:
        found = [(each.track_id, each.started_s) for each in tracks.by_end(session)]
    assert sorted(found) == [("1", at_s), ("2", at_s)]


def test_estimate_after_an_answer_before_the_setback_counts(site):
    for _ in range(3):
        site.bench.see(moved(tilt_deg=8.0))
    site.http.post("/cameras/corner/pose/put-back").raise_for_status()
    site.set_back()
    assert site.bench.pose()["state"] == "learning"
    site.bench.see(PRIOR)
    assert site.bench.pose()["state"] == "ok"


def test_ground_is_by_the_pose_that_was_put_back_before_the_setback(site):
    """For a day it was by the pose of the drift, which was over."""
    right = site.ground()
    for _ in range(3):
        site.bench.see(moved(tilt_deg=8.0))
    wrong = site.ground()
    assert abs(wrong - right) > 1
    site.http.post("/cameras/corner/pose/put-back").raise_for_status()
    site.set_back()
    assert site.ground() == right


def test_ground_is_by_the_pose_that_was_accepted_before_the_setback(site):
    for _ in range(3):
        site.bench.see(moved(tilt_deg=8.0))
    accepted = site.ground()
    site.http.post("/cameras/corner/pose/accept").raise_for_status()
    site.set_back()
    assert site.ground() == accepted


def test_setback_of_a_large_store_is_followed_within_seconds(site):
    """All is one transaction, and others wait to write: 5,000 tracks take 0.1 s of a CPU."""
    batch = [track(str(n), site.clock.now_s() - 50_000 + 2 * n) for n in range(5_000)]
    for at in range(0, len(batch), 2_000):
        body = {"tracks": batch[at : at + 2_000]}
        site.http.post("/cameras/corner/tracks", json=body).raise_for_status()
    begun_s = time.process_time()
    site.set_back()
    assert time.process_time() - begun_s < 2


def test_page_session_ends_after_its_hours(site):
    """It lasted for as long as the clock jumped beside."""
    with site.store.write() as session:
        text = tokens.make_token(session, TokenSpec(name="ada", scopes=("read",)), None).text
        cookie = log_in(session, site.settings, check_login(session, text))
    site.set_back()
    with site.store.read() as session:
        site.later(hours=site.settings.session_hours, minutes=-1)
        assert caller_of_session(session, cookie) is not None
        site.later(hours=site.settings.session_hours, minutes=1)
        assert caller_of_session(session, cookie) is None


def test_silence_that_the_clock_made_up_ends_with_the_next_track(site):
    """The alert stayed open until the clock was where it had been."""
    site.post()
    site.later(days=40)
    with site.store.write() as session:
        watch_data_gap(session, site.settings, "corner", datetime.now(UTC) + site.clock.ahead)
    assert site.firing() == ["no_data"]
    site._watch.look(site.context)
    site.set_back()
    time.sleep(0.01)
    site.post()
    with site.store.write() as session:
        watch_data_gap(session, site.settings, "corner", datetime.now(UTC))
    assert site.firing() == []


def test_alert_is_escalated_in_its_time(site):
    settings = site.settings.model_copy(update={"escalate_after_min": 10})
    for _ in range(3):
        site.bench.see(moved(tilt_deg=8.0))
    site.set_back()
    for minutes, escalated in ((9, False), (11, True)):
        site.later(minutes=minutes)
        with site.store.write() as session:
            escalate(session, settings)
        (alert,) = site.http.get("/alerts").json()["items"]
        assert (alert["escalated_at"] is not None) is escalated


def test_alert_given_back_before_the_setback_is_escalated(site):
    settings = site.settings.model_copy(update={"escalate_after_min": 10})
    for _ in range(3):
        site.bench.see(moved(tilt_deg=8.0))
    (alert,) = site.http.get("/alerts").json()["items"]
    for acknowledged in (True, False):
        url = f"/alerts/{alert['id']}/acknowledge"
        site.http.post(url, json={"acknowledged": acknowledged, "by": "Ada"}).raise_for_status()
    site.set_back()
    site.later(minutes=11)
    with site.store.write() as session:
        escalate(session, settings)
    assert site.http.get("/alerts").json()["items"][0]["escalated_at"] is not None


def test_other_source_that_stopped_ends_its_alert(site):
    for source in ("bytetrack", "other"):
        site.post(source)
    queue = site.context.queue
    with site.store.write() as session:
        references.newest(session, "corner").source = "bytetrack"
        now = datetime.now(UTC) + site.clock.ahead
        watch_sources(session, queue, site.settings, "corner", now)
    assert site.firing() == ["tracker"]
    site.set_back()
    with site.store.write() as session:
        now = datetime.now(UTC) + timedelta(hours=site.settings.source_silent_h, minutes=1)
        sources.find(session, "corner", "bytetrack").last_seen_at = now
        watch_sources(session, queue, site.settings, "corner", now)
    assert site.firing() == []


def test_estimate_queued_before_the_setback_waits_behind_no_later_one(site):
    """It waited until no camera with a later due time did: on a busy machine for a day."""
    site.http.post("/cameras", json={**CAMERA, "id": "second"}).raise_for_status()
    with site.store.write() as session:
        request_estimate(session, site.context.queue, "corner", watched=True)
    site.set_back()
    site.later(minutes=2)
    with site.store.write() as session:
        request_estimate(session, site.context.queue, "second", watched=True)
    query = (
        "SELECT deduplication_id FROM workflow_status WHERE status = 'ENQUEUED' "
        "AND deduplication_id IN ('corner', 'second') ORDER BY priority"
    )
    assert [name for (name,) in ask(site.settings, query)] == ["corner", "second"]


def test_answer_can_be_undone_for_its_minutes_alone(site):
    for _ in range(3):
        site.bench.see(moved(tilt_deg=8.0))
    site.http.post("/cameras/corner/pose/put-back").raise_for_status()
    site.set_back()
    site.later(minutes=16)
    assert site.http.post("/cameras/corner/pose/undo").status_code == 409


def test_tracks_are_kept_for_their_days(site):
    site.post()
    site.set_back()
    for hours, count in ((-1, 1), (1, 0)):
        site.later(days=site.settings.keep_days, hours=hours)
        run_retention(site.context)
        with site.store.read() as session:
            assert tracks.counts(session, ["corner"]).get("corner", 0) == count


def test_periodic_work_goes_on(site):
    site.bench.see(PRIOR)
    site.set_back()
    before = site.http.get("/readyz").json()
    run_reconcile(site.context, StaleWatch())
    run_retention(site.context)
    assert site.firing() == []
    assert before["queue_lag_s"] >= 0


def test_no_time_of_the_service_is_left_in_the_future(site):
    """Times that people and trackers state, and the log, stay as they are."""
    for _ in range(3):
        site.bench.see(moved(tilt_deg=8.0))
    now = datetime.now(UTC)
    days = {days: (now + timedelta(days=days)).isoformat() for days in (5, 9)}
    for body in ({"to": days[5]}, {"from": days[5], "to": days[9]}):
        site.http.post("/cameras/corner/maintenance", json=body).raise_for_status()
    site.http.post("/cameras/corner/pose/put-back").raise_for_status()
    with site.store.read() as session:
        order = [each.created_at for each in estimates.between(session, "corner", None, None, 99)]
        answered = references.newest(session, "corner").answered_at
        planned = [(each.from_at, each.to_at) for each in session.query(MaintenanceRecord)]
    site.set_back()
    now = datetime.now(UTC).replace(tzinfo=None).isoformat(" ")
    left = []
    for table in Record.metadata.sorted_tables:
        for column in table.columns:
            if isinstance(column.type, UtcDateTime):
                query = f"SELECT 1 FROM {table.name} WHERE {column.name} > '{now}' LIMIT 1"
                left += [str(column)] if ask(site.settings, query) else []
    assert set(left) == {
        "activity.at",
        "activity.until",
        "maintenance_windows.from_at",
        "maintenance_windows.to_at",
    }
    with site.store.read() as session:
        found = [each.created_at for each in estimates.between(session, "corner", None, None, 99)]
        assert found == [at - site.back for at in order]  # to the microsecond
        assert references.newest(session, "corner").answered_at == answered - site.back
        (begun_at, to_at), *later = sorted(planned)
        found = [(each.from_at, each.to_at) for each in session.query(MaintenanceRecord)]
        assert sorted(found) == [(begun_at - site.back, to_at), *later]
