"""The served pose out of the store: predictions in, estimate, drift, alert and events out."""

import math
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from fastapi.testclient import TestClient

from models.geometry.pose import CameraPose
from models.regression.recipe import plan_to_config
from service.app import create_app
from service.recalibration.estimates import store_estimate
from service.recalibration.trainings import begin_training, publish_model
from service.store import events, tracks, trainings
from service.store.database import Store
from tests.conftest import track
from tests.service.conftest import problem

PRIOR = CameraPose(
    height_m=6.0, tilt_rad=math.radians(22), roll_rad=math.radians(1), heading_rad=math.radians(40)
)


class Bench:
    """A camera with a published model, whose predictions a test makes up."""

    def __init__(self, http, settings):
        self.http, self.settings = http, settings
        self.store = Store(settings)
        self.clock_s = datetime.now(UTC).timestamp() - 3600
        self.count = 0
        self.publish()

    def publish(self):
        queue = NoQueue()
        with self.store.write() as session:
            training = trainings.unfinished(session, "corner")[0]
            attempt = begin_training(session, self.settings, training.id)
            publish_model(session, queue, attempt, weights_sha256="0" * 64, metrics={})
            self.model_id = trainings.newest_model(session, "corner").id
        assert plan_to_config(attempt.plan)["recipe"]["name"] == "default"

    def see(self, pose: CameraPose, people: int = 20, spread_deg: float = 2.0):
        """Post people, each predicted near a pose, and bring the estimate up to date."""
        rng = np.random.default_rng(self.count)
        first = self.count
        self.count += people
        self.clock_s += 60
        batch = [track(str(first + n), start_s=self.clock_s + n) for n in range(people)]
        self.http.post("/cameras/corner/tracks", json={"tracks": batch}).raise_for_status()
        noise = np.radians(spread_deg) * rng.standard_normal((people, 2))
        noise -= noise.mean(axis=0)  # so that the mean is what the test says
        rows = []
        with self.store.write() as session:
            window = tracks.window(session, "corner", 400, 7)
            pending = tracks.without_prediction(session, "corner", self.model_id, window, people)
            for record, (tilt, roll) in zip(pending, noise, strict=True):
                q = CameraPose(
                    height_m=1.0,
                    tilt_rad=pose.tilt_rad + tilt,
                    roll_rad=pose.roll_rad + roll,
                    heading_rad=PRIOR.heading_rad,
                ).quaternion_wxyz
                rows.append(
                    dict(zip(("qw", "qx", "qy", "qz"), map(float, q), strict=True))
                    | {"model_id": self.model_id, "track_pk": record.id, "windows": 1}
                    | {"height_m": pose.height_m}
                )
            tracks.add_predictions(session, rows)
        return self.refresh()

    def refresh(self):
        with self.store.write() as session:
            return store_estimate(session, self.settings, "corner")

    def pose(self):
        return self.http.get("/cameras/corner/pose").json()

    def alerts(self, **query):
        return self.http.get("/alerts", params=query).json()["items"]

    def events(self, type_):
        with self.store.read() as session:
            return [e.payload for e in events.after(session, 0, 1000) if e.type == type_]


class NoQueue:
    def enqueue_estimate(self, session, camera_id):
        pass


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
    assert "training is queued" in body["reason"]
    assert "0 tracks" in body["reason"]


def test_the_pose_is_the_mean_and_heading_is_carried_over(bench):
    bench.see(moved(tilt_deg=1.0, roll_deg=-0.5, height_m=0.2))
    body = bench.pose()
    assert body["state"] == "ok"
    assert body["estimated"] == ["height_m", "tilt_deg", "roll_deg"]
    assert body["pose"]["height_m"] == pytest.approx(6.2)
    assert body["pose"]["tilt_deg"] == pytest.approx(23.0, abs=0.02)
    assert body["pose"]["roll_deg"] == pytest.approx(0.5, abs=0.02)
    assert body["pose"]["heading_deg"] == pytest.approx(40)
    assert body["drift"]["tilt_deg"] == pytest.approx(1.0, abs=0.02)
    assert body["estimates"]["averaged"]["tracks"] == body["tracks"] == 20
    # 2 deg between people, 20 people: 2 / sqrt(20) = 0.45
    assert body["sd"]["tilt_deg"] == pytest.approx(0.45, rel=0.4)
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
        bench.see(moved(tilt_deg=1.9, roll_deg=-1.9, height_m=0.45))
    assert bench.pose()["state"] == "ok"
    for _ in range(5):
        bench.see(moved(tilt_deg=5.0), spread_deg=8.0)  # 4 sd = 4 * 8 / sqrt(20) = 7 deg
    assert bench.pose()["state"] == "ok"
    assert bench.alerts() == []


def test_an_alert_clears_with_hysteresis(bench):
    for _ in range(3):
        bench.see(moved(height_m=0.8))
    for _ in range(4):
        bench.see(moved(height_m=0.4))  # below the floor of 0.5 m, not below 0.7 of it
    assert len(bench.alerts(state="firing")) == 1
    for _ in range(2):
        bench.see(PRIOR)
    assert len(bench.alerts(state="firing")) == 1
    bench.see(PRIOR)
    (alert,) = bench.alerts()
    assert (alert["state"], alert["outcome"]) == ("resolved", "cleared")
    assert bench.pose()["state"] == "ok"


def test_the_edge_of_the_training_range_is_told(bench):
    bench.see(moved(tilt_deg=14.0))
    assert bench.pose()["state"] == "out_of_range"
    assert bench.alerts()[0]["kind"] == "out_of_range"


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


def test_accepting_makes_the_served_pose_the_prior(bench):
    problem(bench.http.post("/cameras/corner/pose/accept"), 409, "conflict")
    for _ in range(3):
        bench.see(moved(tilt_deg=5.0))
    body = bench.http.post("/cameras/corner/pose/accept", json={"by": "Ada"}).json()
    assert body["state"] == "learning"
    assert body["pose"]["tilt_deg"] == pytest.approx(27.0, abs=0.05)
    assert bench.alerts()[0]["outcome"] == "accepted"
    prior = bench.http.get("/cameras/corner").json()["prior_pose"]
    assert prior["tilt_deg"] == pytest.approx(27.0, abs=0.05)
    assert bench.http.get("/cameras/corner/trainings").json()["items"][0]["state"] == "queued"


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


def test_tracks_outside_the_window_do_not_count(bench):
    bench.see(moved(tilt_deg=4.0))
    bench.see(PRIOR)  # a window of 20 tracks holds these alone
    assert bench.pose()["pose"]["tilt_deg"] == pytest.approx(22.0, abs=0.02)


def test_too_few_tracks_are_counted_in_words(bench):
    assert bench.see(PRIOR, people=4) is None
    assert "4 tracks are stored; at least 5" in bench.pose()["reason"]
