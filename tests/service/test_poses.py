"""The served pose out of the store: findings in, estimate, drift, alert and events out."""

import math
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from fastapi.testclient import TestClient

from models.estimation.joint.estimate import JointEstimate
from models.geometry.pose import CameraPose
from models.regression.recipe import plan_to_config
from service.app import create_app
from service.job_queue import JobQueue
from service.recalibration.estimates import store_estimate
from service.recalibration.evidence import Finding, gather
from service.recalibration.trainings import begin_training, end_training, publish_model
from service.store import events, references, trainings
from service.store.database import Store
from tests.conftest import track
from tests.service.conftest import problem

PRIOR = CameraPose(
    height_m=6.0, tilt_rad=math.radians(22), roll_rad=math.radians(1), heading_rad=math.radians(40)
)


class Bench:
    """A camera with a reference, about whose tracks a test makes up what they come to."""

    def __init__(self, http, settings):
        self.http, self.settings = http, settings
        self.store = Store(settings)
        self.queue = JobQueue(self.store.engine)
        self.clock_s = datetime.now(UTC).timestamp() - 3600
        self.count = 0
        self.publish()
        self.learn()

    def publish(self):
        with self.store.write() as session:
            training = trainings.unfinished(session, "corner")[0]
            attempt = begin_training(session, self.settings, training.id)
            publish_model(session, self.queue, attempt, weights_sha256="0" * 64, metrics={})
            self.model_id = trainings.newest_model(session, "corner").id
        assert plan_to_config(attempt.plan)["recipe"]["name"] == "default"
        return attempt.plan

    def learn(self):
        with self.store.write() as session:
            reference = references.newest(session, "corner")
            reference.to_s, reference.tracks, reference.data = self.clock_s, 200, b"made up"
            reference.walking_speed_mps = 1.27
            reference.ready_at = datetime.now(UTC)

    def see(
        self, pose: CameraPose, people: int = 20, sd_deg=0.2, sd_log=0.01, weak=(), change=None
    ):
        """Post people, who come to a pose, and bring the estimate up to date."""
        first = self.count
        self.count += people
        self.clock_s += 60
        batch = [track(str(first + n), start_s=self.clock_s + n) for n in range(people)]
        self.http.post("/cameras/corner/tracks", json={"tracks": batch}).raise_for_status()
        with self.store.write() as session:
            evidence = gather(session, self.settings, "corner")
            if evidence is None:
                return None
            values = np.array([pose.tilt_rad, pose.roll_rad, math.log(pose.height_m)])
            sd = np.array([math.radians(sd_deg), math.radians(sd_deg), sd_log])
            joint = JointEstimate(
                values=values,
                covariance=np.diag(sd**2),
                raw=values + 0.01,
                walkers=len(evidence.tracks),
                parties=len(evidence.tracks),
                weak=tuple(weak),
                reason=f"the tracks cannot tell {' and '.join(weak)}" if weak else "",
            )
            finding = Finding(
                joint=joint,
                averaged=None,
                tracks=evidence.tracks,
                change=None if change is None else evidence.tracks[change],
            )
            return store_estimate(session, self.queue, self.settings, evidence, finding)

    def refresh(self):
        with self.store.read() as session:
            return gather(session, self.settings, "corner")

    def pose(self):
        return self.http.get("/cameras/corner/pose").json()

    def alerts(self, **query):
        return self.http.get("/alerts", params=query).json()["items"]

    def trainings(self):
        return self.http.get("/cameras/corner/trainings").json()["items"]

    def events(self, type_):
        with self.store.read() as session:
            return [e.payload for e in events.after(session, 0, 1000) if e.type == type_]


def moved(tilt_deg=0.0, roll_deg=0.0, height_m=0.0):
    return CameraPose(
        height_m=PRIOR.height_m + height_m,
        tilt_rad=PRIOR.tilt_rad + math.radians(tilt_deg),
        roll_rad=PRIOR.roll_rad + math.radians(roll_deg),
        heading_rad=PRIOR.heading_rad,
    )


@pytest.fixture
def bench(corner, settings):
    return Bench(corner, settings.model_copy(update={"window_tracks": 20}))


def test_before_there_is_an_estimate_the_prior_pose_is_served(corner):
    body = corner.get("/cameras/corner/pose").json()
    assert body["state"] == "learning"
    assert body["estimated"] == []
    assert body["pose"]["tilt_deg"] == pytest.approx(22)
    assert (body["sd"], body["drift"], body["from"], body["to"]) == (None, None, None, None)
    assert body["reason"] == "0 of 200 reference tracks"
    assert body["reference"] == {
        "state": "learning", "tracks": 0, "wanted": 200, "walking_speed_mps": None,
    }  # fmt: skip


def test_the_pose_is_the_estimate_and_heading_is_carried_over(bench):
    bench.see(moved(tilt_deg=0.9, roll_deg=-0.5, height_m=0.2))
    body = bench.pose()
    assert body["state"] == "ok"
    assert body["estimated"] == ["height_m", "tilt_deg", "roll_deg"]
    assert body["pose"]["height_m"] == pytest.approx(6.2)
    assert body["pose"]["tilt_deg"] == pytest.approx(22.9)
    assert body["pose"]["roll_deg"] == pytest.approx(0.5)
    assert body["pose"]["heading_deg"] == pytest.approx(40)
    assert body["drift"]["tilt_deg"] == pytest.approx(0.9)
    assert body["drift"]["angle_deg"] == pytest.approx(math.hypot(0.9, 0.5), rel=0.01)
    assert body["sd"]["tilt_deg"] == pytest.approx(0.2)
    assert body["sd"]["height_m"] == pytest.approx(0.01 * 6.2)
    raw = body["estimates"]["joint"]  # before the reference's offset is taken off
    assert raw["tilt_deg"] == pytest.approx(22.9 + math.degrees(0.01))
    assert raw["tracks"] == body["tracks"] == 20
    assert body["reference"] == {
        "state": "ready", "tracks": 200, "wanted": 200, "walking_speed_mps": 1.27,
    }  # fmt: skip
    assert body["model_id"] == bench.model_id


def test_the_etag_changes_with_the_answer_only(bench):
    bench.see(PRIOR)
    first = bench.http.get("/cameras/corner/pose")
    again = bench.http.get("/cameras/corner/pose", headers={"If-None-Match": first.headers["ETag"]})
    assert again.status_code == 304
    bench.see(moved(tilt_deg=0.5))
    after = bench.http.get("/cameras/corner/pose", headers={"If-None-Match": first.headers["ETag"]})
    assert after.status_code == 200
    assert after.headers["ETag"] != first.headers["ETag"]


def test_a_refresh_without_news_writes_nothing(bench):
    assert bench.see(PRIOR) is not None
    assert bench.refresh() is None
    assert len(bench.http.get("/cameras/corner/pose/history").json()["items"]) == 1


def test_a_drift_fires_after_three_updates_and_is_one_alert(bench):
    knocked = moved(tilt_deg=5.0)
    assert bench.see(PRIOR).state == "ok"
    assert bench.see(knocked).state == "ok"
    assert bench.see(knocked).state == "ok"
    assert bench.alerts() == []
    assert "2 of 3 updates" in bench.pose()["reason"]
    assert bench.see(knocked).state == "drifting"
    bench.see(knocked)
    (alert,) = bench.alerts(state="firing")
    assert (alert["kind"], alert["severity"]) == ("drift", "critical")
    assert alert["drift"]["tilt_deg"] == pytest.approx(5.0, abs=0.05)
    assert bench.pose()["state"] == "drifting"
    assert [e["state"] for e in bench.events("alert")] == ["firing"]
    changed = datetime.fromisoformat(alert["changed_at"])
    opened = datetime.fromisoformat(alert["opened_at"])
    assert changed < opened - timedelta(minutes=30)  # the tracks' clock, an hour ago


def test_a_drift_below_the_floor_or_within_its_sd_is_none(bench):
    for _ in range(5):
        bench.see(moved(tilt_deg=0.95, roll_deg=-0.95, height_m=0.28))
    assert bench.pose()["state"] == "ok"
    for _ in range(5):
        bench.see(moved(tilt_deg=5.0), sd_deg=1.3)  # 4 sd = 5.2 deg
    assert bench.pose()["state"] == "ok"
    assert bench.alerts() == []


def test_an_alert_clears_with_hysteresis(bench):
    for _ in range(3):
        bench.see(moved(tilt_deg=1.5))
    for _ in range(4):
        bench.see(moved(tilt_deg=0.8))  # below the floor of 1 deg, not below 0.7 of it
    assert len(bench.alerts(state="firing")) == 1
    for _ in range(2):
        bench.see(PRIOR)
    assert len(bench.alerts(state="firing")) == 1
    bench.see(PRIOR)
    (alert,) = bench.alerts()
    assert (alert["state"], alert["outcome"]) == ("resolved", "cleared")
    assert bench.pose()["state"] == "ok"


def test_out_of_range_queues_one_training_around_the_estimate(bench):
    far = moved(tilt_deg=14.0)
    for _ in range(4):
        bench.see(far)
    body = bench.pose()
    assert body["state"] == "out_of_range"
    assert "a training around the new estimate is queued" in body["reason"]
    assert body["pose"]["tilt_deg"] == pytest.approx(36.0)
    assert {alert["kind"] for alert in bench.alerts(state="firing")} == {"out_of_range", "drift"}
    queued, first = bench.trainings()
    assert (queued["state"], first["state"], first["around"]) == ("queued", "succeeded", None)
    assert queued["around"]["tilt_deg"] == pytest.approx(36.0)
    plan = bench.publish()
    assert plan.prior_pose.tilt_rad == pytest.approx(far.tilt_rad)
    assert plan.prior_pose.heading_rad == PRIOR.heading_rad
    bench.see(far)
    assert bench.pose()["state"] == "drifting"
    assert [alert["kind"] for alert in bench.alerts(state="firing")] == ["drift"]
    assert len(bench.trainings()) == 2


def test_a_training_around_the_estimate_that_failed_is_not_queued_again(bench):
    bench.see(moved(tilt_deg=14.0))
    with bench.store.write() as session:
        attempt = begin_training(session, bench.settings, bench.trainings()[0]["id"])
        end_training(session, attempt, "failed", "no walk is possible")
    bench.see(moved(tilt_deg=14.1))
    assert "the new estimate has failed" in bench.pose()["reason"]
    assert len(bench.trainings()) == 2
    bench.see(moved(tilt_deg=14.1, height_m=2.8))  # another pose: more than a metre away
    assert len(bench.trainings()) == 3


def test_a_number_that_is_not_told_is_nowhere_taken_for_known(bench):
    for _ in range(4):
        bench.see(moved(tilt_deg=5.0, roll_deg=0.3), weak=("tilt", "height"))
    body = bench.pose()
    assert body["state"] == "ok"
    assert body["estimated"] == ["roll_deg"]
    assert body["pose"]["tilt_deg"] == pytest.approx(22.0)
    assert body["pose"]["height_m"] == pytest.approx(6.0)
    assert body["pose"]["roll_deg"] == pytest.approx(1.3)
    assert body["sd"] == {"height_m": None, "tilt_deg": None, "roll_deg": pytest.approx(0.2)}
    assert body["drift"]["tilt_deg"] is None
    assert body["drift"]["angle_deg"] == pytest.approx(0.3)
    assert "cannot tell tilt and height" in body["reason"]
    assert bench.alerts() == []
    items = bench.http.get("/cameras/corner/pose/history").json()["items"]
    assert items[-1]["tilt_deg"] == pytest.approx(22.0)
    assert items[-1]["drift"]["height_m"] is None


def test_where_nothing_is_told_the_state_is_never_ok(bench):
    everything = ("tilt", "roll", "height")
    bench.see(PRIOR)
    assert bench.pose()["state"] == "ok"
    bench.see(moved(tilt_deg=5.0), weak=everything)
    body = bench.pose()
    assert (body["state"], body["estimated"]) == ("learning", [])
    assert (body["sd"], body["drift"]) == (None, None)
    problem(bench.http.post("/cameras/corner/pose/accept"), 409, "conflict")
    for _ in range(3):
        bench.see(moved(tilt_deg=5.0))
    for _ in range(4):
        bench.see(PRIOR, weak=everything)
    assert bench.pose()["state"] == "drifting"  # what is not told ends no alert
    (alert,) = bench.alerts(state="firing")
    assert alert["drift"]["tilt_deg"] == pytest.approx(5.0)


def test_an_alert_ends_only_where_what_drifted_is_told_again(bench):
    for _ in range(3):
        bench.see(moved(tilt_deg=5.0))
    for _ in range(5):
        bench.see(PRIOR, weak=("tilt",))
    assert len(bench.alerts(state="firing")) == 1
    for _ in range(3):
        bench.see(PRIOR, weak=("roll",))
    assert bench.alerts(state="firing") == []


def test_a_jump_in_scale_alone_is_named_a_clock_fault(bench):
    for _ in range(3):
        bench.see(moved(height_m=1.2))
    body = bench.pose()
    assert body["state"] == "drifting"
    assert "as if 30 frames a second were taken for 25" in body["reason"]
    (alert,) = bench.alerts()
    assert (alert["kind"], alert["state"]) == ("clock", "firing")
    assert alert["drift"]["height_m"] == pytest.approx(1.2)
    assert "+20 %" in alert["reason"]
    for _ in range(3):
        bench.see(PRIOR)
    assert [alert["outcome"] for alert in bench.alerts()] == ["cleared"]


def test_a_drift_that_turns_out_to_be_the_clock_is_told_once(bench):
    for _ in range(3):
        bench.see(moved(height_m=0.42))  # 7 %: the window is still half of the time before
    assert [alert["kind"] for alert in bench.alerts(state="firing")] == ["drift"]
    bench.see(moved(height_m=1.2))
    bench.see(moved(height_m=1.2, tilt_deg=0.5))  # beyond 2 sd, yet no drift of its own
    assert [alert["kind"] for alert in bench.alerts(state="firing")] == ["clock"]
    bench.see(moved(height_m=1.2, tilt_deg=4.0))
    assert [alert["kind"] for alert in bench.alerts(state="firing")] == ["drift"]


def test_the_alert_says_when_the_camera_moved(bench):
    bench.see(PRIOR)
    bench.see(moved(tilt_deg=5.0), change=4)
    with bench.store.read() as session:
        reference = references.newest(session, "corner")
        first = reference.changed_s
        assert reference.window_from_s == pytest.approx(first + 0.4 * 19)
    for _ in range(2):
        bench.see(moved(tilt_deg=5.0))
    (alert,) = bench.alerts(state="firing")
    assert datetime.fromisoformat(alert["changed_at"]).timestamp() == pytest.approx(first)
    body = bench.pose()
    assert datetime.fromisoformat(body["from"]).timestamp() >= first


def test_acknowledge_keeps_the_first_and_resolve_ends(bench):
    for _ in range(3):
        bench.see(moved(roll_deg=-4.0))
    alert_id = bench.alerts()[0]["id"]
    url = f"/alerts/{alert_id}"
    bench.http.post(f"{url}/acknowledge", json={"by": "Ada"})
    body = bench.http.post(f"{url}/acknowledge", json={"by": "Bob"}).json()
    assert body["acknowledged_by"] == "Ada"
    bad = bench.http.post(f"{url}/resolve", json={"outcome": "whatever"})
    problem(bad, 422, "malformed")
    body = bench.http.post(
        f"{url}/resolve", json={"outcome": "false_alarm", "note": "a parade", "by": "Ada"}
    ).json()
    assert (body["state"], body["outcome"], body["note"]) == ("resolved", "false_alarm", "a parade")
    assert bench.http.get(url).json() == body
    problem(bench.http.post(f"{url}/acknowledge"), 409, "conflict")
    problem(bench.http.get("/alerts/none"), 404, "not_found")
    bench.see(moved(roll_deg=-4.0))
    assert bench.alerts(state="firing") == []  # it has to earn its three updates anew
    for _ in range(2):
        bench.see(moved(roll_deg=-4.0))
    assert len(bench.alerts(state="firing")) == 1


def test_accepting_makes_the_served_pose_the_prior_and_begins_a_reference(bench):
    problem(bench.http.post("/cameras/corner/pose/accept"), 409, "conflict")
    for _ in range(3):
        bench.see(moved(tilt_deg=5.0))
    body = bench.http.post("/cameras/corner/pose/accept", json={"by": "Ada"}).json()
    assert body["state"] == "learning"
    assert body["reason"] == "0 of 200 reference tracks"  # the tracks so far led to the new pose
    assert body["reference"]["state"] == "learning"
    assert body["pose"]["tilt_deg"] == pytest.approx(27.0)
    assert bench.alerts()[0]["outcome"] == "accepted"
    prior = bench.http.get("/cameras/corner").json()["prior_pose"]
    assert prior["tilt_deg"] == pytest.approx(27.0)
    assert bench.trainings()[0]["state"] == "queued"
    bench.see(moved(tilt_deg=5.0), people=7)
    assert bench.pose()["reason"] == "7 of 200 reference tracks"
    with bench.store.read() as session:
        reference = references.newest(session, "corner")
        assert (reference.origin, reference.requested_by) == ("accepted", "Ada")


def test_a_reset_takes_the_camera_to_be_back_at_its_prior_pose(bench):
    for _ in range(3):
        bench.see(moved(tilt_deg=14.0))
    body = bench.http.post("/cameras/corner/reference/reset", json={"by": "Ada"}).json()
    assert (body["state"], body["estimated"]) == ("learning", [])
    assert body["pose"]["tilt_deg"] == pytest.approx(22.0)
    assert body["reference"]["walking_speed_mps"] is None
    assert {alert["kind"] for alert in bench.alerts()} == {"drift", "out_of_range"}
    assert {(a["outcome"], a["resolved_by"]) for a in bench.alerts()} == {("put_back", "Ada")}
    bench.see(PRIOR, people=7)
    assert bench.pose()["reference"]["tracks"] == 7
    assert bench.http.post("/cameras/corner/reference/reset").status_code == 200  # no body needed
    problem(bench.http.post("/cameras/nowhere/reference/reset"), 404, "not_found")


def test_the_number_of_reference_tracks_can_change_while_they_are_awaited(corner):
    batch = [track(str(n), start_s=1_700_000_000.0 + n) for n in range(9)]
    corner.post("/cameras/corner/tracks", json={"tracks": batch})
    assert corner.get("/cameras/corner/pose").json()["reason"] == "9 of 200 reference tracks"
    change = {"reference_tracks": 50}
    corner.patch("/cameras/corner", json=change, headers={"If-Match": "*"}).raise_for_status()
    assert corner.get("/cameras/corner/pose").json()["reason"] == "9 of 50 reference tracks"


def test_other_tracks_are_wanted_after_another_pose_but_not_after_another_speed(corner):
    batch = [track(str(n), start_s=1_700_000_000.0 + n) for n in range(9)]
    corner.post("/cameras/corner/tracks", json={"tracks": batch})
    for change, left in (
        ({"walking_speed": {"mean_mps": 1.2}}, 9),
        ({"prior_pose": {"height_m": 5.0, "tilt_deg": 20.0}}, 0),
    ):
        corner.patch("/cameras/corner", json=change, headers={"If-Match": "*"}).raise_for_status()
        body = corner.get("/cameras/corner/pose").json()
        assert body["reason"] == f"{left} of 200 reference tracks"


def test_another_prior_pose_ends_the_alert_against_the_old_one(bench):
    for _ in range(3):
        bench.see(moved(tilt_deg=5.0))
    change = {"prior_pose": {"height_m": 6.0, "tilt_deg": 27.0, "roll_deg": 1.0}}
    bench.http.patch("/cameras/corner", json=change, headers={"If-Match": "*"}).raise_for_status()
    assert [alert["outcome"] for alert in bench.alerts()] == ["accepted"]
    assert bench.pose()["estimated"] == []  # what was measured against the old one is gone


def test_history_is_a_series_between_two_times(bench):
    for tilt_deg in (0.0, 0.5, 1.0):
        bench.see(moved(tilt_deg=tilt_deg))
    items = bench.http.get("/cameras/corner/pose/history").json()["items"]
    assert [round(item["tilt_deg"], 1) for item in items] == [22.0, 22.5, 23.0]
    late = bench.http.get("/cameras/corner/pose/history", params={"from": items[1]["at"]}).json()
    assert len(late["items"]) == 2
    newest = bench.http.get("/cameras/corner/pose/history", params={"limit": 1}).json()["items"]
    assert newest == items[-1:]
    bad = bench.http.get("/cameras/corner/pose/history", params={"from": "2026-01-01T00:00:00"})
    problem(bad, 422, "malformed")


def test_silence_is_no_data(bench):
    bench.see(PRIOR)
    strict = bench.settings.model_copy(update={"no_data_after_h": 0.5})
    with TestClient(create_app(strict)) as http:
        body = http.get("/cameras/corner/pose").json()
    assert body["state"] == "no_data"
    assert "0.5 h" in body["reason"]


def test_too_few_tracks_since_the_reference_are_counted_in_words(bench):
    assert bench.see(PRIOR, people=4) is None
    body = bench.pose()
    assert (body["state"], body["estimated"]) == ("learning", [])
    assert "4 tracks since the reference; at least 5" in body["reason"]
