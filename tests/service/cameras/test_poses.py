"""The served pose out of the store: findings in, pose, reason, history and reference out."""

import math
from datetime import UTC, datetime, timedelta

import pytest
from fastapi.testclient import TestClient

from service.app import create_app
from service.store import references
from tests.conftest import track
from tests.service.bench import PRIOR, moved
from tests.service.conftest import problem


def test_before_there_is_an_estimate_the_prior_pose_is_served(corner):
    body = corner.get("/cameras/corner/pose").json()
    assert (body["state"], body["reason_code"]) == ("unconnected", "nobody_posted")
    assert body["estimated"] == []
    assert body["pose"]["tilt_deg"] == pytest.approx(22)
    assert (body["sd"], body["drift"], body["from"], body["to"]) == (None, None, None, None)
    assert body["moved"] is None
    assert body["moved_parameters"] == dict.fromkeys(
        ("height_m", "tilt_deg", "roll_deg", "heading_deg")
    )
    assert body["since"] == {"after": None, "before": None}
    assert body["reason"] == "no track of anybody has been posted for it yet"
    assert body["reference"] == {
        "state": "learning", "tracks": 0, "counted": 0, "pieces": 0, "hours": 0, "wanted": 200,
        "walking_speed_mps": None,
    }  # fmt: skip


def test_a_camera_is_unconnected_until_a_track_of_it_is_stored(corner):
    def state():
        return corner.get("/cameras/corner/pose").json()["state"]

    bad = {**track("1"), "points": track("1")["points"][:2]}
    for body, status in (({"tracks": []}, 202), ({"tracks": [bad]}, 422)):
        assert corner.post("/cameras/corner/tracks", json=body).status_code == status
        assert state() == "unconnected"
    corner.post("/cameras/corner/tracks", json={"tracks": [track("1")]}).raise_for_status()
    assert state() == "learning"
    corner.post("/cameras/corner/reference/reset").raise_for_status()
    assert state() == "learning"  # somebody has posted, and is waited for


def test_the_pose_is_the_estimate_and_heading_is_carried_over(bench):
    bench.see(moved(tilt_deg=1.9, roll_deg=-1.5, height_m=0.2), sd_deg=0.02, sd_log=0.001)
    body = bench.pose()
    assert body["state"] == "drifting"
    assert body["estimated"] == ["height_m", "tilt_deg", "roll_deg"]
    assert body["pose"]["height_m"] == pytest.approx(6.2, abs=0.002)
    assert body["pose"]["tilt_deg"] == pytest.approx(23.9, abs=0.01)
    assert body["pose"]["roll_deg"] == pytest.approx(-0.5, abs=0.01)
    assert body["pose"]["heading_deg"] == pytest.approx(40)
    assert body["drift"]["tilt_deg"] == pytest.approx(1.9, abs=0.01)
    assert body["drift"]["angle_deg"] == pytest.approx(math.hypot(1.9, 1.5), rel=0.02)
    assert body["sd"]["tilt_deg"] == pytest.approx(math.hypot(0.02, 0.1), rel=0.05)
    assert body["sd"]["height_m"] == pytest.approx(math.hypot(0.001, 0.003) * 6.2, rel=0.05)
    raw = body["estimates"]["joint"]  # before the reference's offset is taken off
    assert raw["tilt_deg"] == pytest.approx(23.9 + math.degrees(0.01))
    assert raw["tracks"] == body["tracks"] == 20
    assert body["reference"] == {
        "state": "ready", "tracks": 200, "counted": 200, "pieces": 0, "hours": 0, "wanted": 200,
        "walking_speed_mps": 1.27,
    }  # fmt: skip
    assert body["model_id"] == bench.model_id


def test_a_told_heading_is_in_the_pose_and_all_that_is_said_of_it(bench):
    bench.see(moved(tilt_deg=2.5, heading_deg=-2.9), paths=True, sd_deg=0.02)
    body = bench.pose()
    assert body["estimated"] == ["height_m", "tilt_deg", "roll_deg", "heading_deg"]
    assert body["pose"]["heading_deg"] == pytest.approx(37.1, abs=0.01)
    assert body["drift"]["heading_deg"] == pytest.approx(-2.9, abs=0.01)
    assert body["drift"]["angle_deg"] == pytest.approx(math.hypot(2.5, 2.9), rel=0.1)
    assert body["sd"]["heading_deg"] == pytest.approx(math.hypot(0.02, 0.1), rel=0.05)
    assert "heading -2.90 deg (sd 0.10)" in body["reason"]
    assert body["estimates"]["registered"] == {
        "height_m": pytest.approx(6.0 * math.exp(0.01)),
        "tilt_deg": pytest.approx(24.5 + math.degrees(0.01)),
        "roll_deg": pytest.approx(1.0 + math.degrees(0.01)),
        "heading_deg": pytest.approx(37.1 + math.degrees(0.01)),
        "tracks": 20,
    }
    bench.see(moved(heading_deg=30.0))
    body = bench.pose()
    assert body["pose"]["heading_deg"] == pytest.approx(40)  # not told: the prior's
    assert (body["sd"]["heading_deg"], body["drift"]["heading_deg"]) == (None, None)
    first, second = bench.http.get("/cameras/corner/pose/history").json()["items"]
    assert [first["heading_deg"], second["heading_deg"]] == pytest.approx([37.1, 40], abs=0.01)
    assert (first["drift"]["heading_deg"], second["drift"]["heading_deg"]) == (
        pytest.approx(-2.9, abs=0.01),
        None,
    )


def test_an_accepted_heading_is_the_new_priors(bench):
    bench.see(moved(heading_deg=5.0), paths=True)
    bench.http.post("/cameras/corner/pose/accept").raise_for_status()
    camera = bench.http.get("/cameras/corner").json()
    assert camera["prior_pose"]["heading_deg"] == pytest.approx(45, abs=0.02)
    assert bench.pose()["pose"]["heading_deg"] == pytest.approx(45, abs=0.02)


def test_the_etag_changes_with_the_answer_only(bench):
    bench.see(PRIOR)
    first = bench.http.get("/cameras/corner/pose")
    again = bench.http.get("/cameras/corner/pose", headers={"If-None-Match": first.headers["ETag"]})
    assert again.status_code == 304
    bench.see(moved(tilt_deg=0.5))
    after = bench.http.get("/cameras/corner/pose", headers={"If-None-Match": first.headers["ETag"]})
    assert after.status_code == 200
    assert after.headers["ETag"] != first.headers["ETag"]


def test_maintenance_that_ends_half_a_second_later_has_an_etag_of_its_own(bench):
    begins = datetime.now(UTC).replace(second=0, microsecond=0)
    answers = []
    for moment in (100_000, 600_000):
        until = (begins + timedelta(hours=1)).replace(microsecond=moment)
        plan = {"from": begins.isoformat(), "to": until.isoformat(), "reason": "cleaning"}
        planned = bench.http.post("/cameras/corner/maintenance", json=plan)
        planned.raise_for_status()
        answers.append(bench.http.get("/cameras/corner/pose"))
        url = f"/cameras/corner/maintenance/{planned.json()['id']}"
        bench.http.delete(url).raise_for_status()
    assert answers[0].json()["reason_values"] != answers[1].json()["reason_values"]
    assert answers[0].headers["ETag"] != answers[1].headers["ETag"]


def test_a_refresh_without_news_writes_nothing(bench):
    assert bench.see(PRIOR) is not None
    assert bench.refresh() is None
    assert len(bench.http.get("/cameras/corner/pose/history").json()["items"]) == 1


def test_a_number_that_is_not_told_is_nowhere_taken_for_known(bench):
    for _ in range(4):
        bench.see(moved(tilt_deg=5.0, roll_deg=1.3), unidentifiable=("tilt", "height"), sd_deg=0.05)
    body = bench.pose()
    assert body["state"] == "drifting"
    assert body["estimated"] == ["roll_deg"]
    assert body["pose"]["tilt_deg"] == pytest.approx(22.0)
    assert body["pose"]["height_m"] == pytest.approx(6.0)
    assert body["pose"]["roll_deg"] == pytest.approx(2.3, abs=0.01)
    sd = body["sd"]
    assert sd.pop("roll_deg") == pytest.approx(math.hypot(0.05, 0.1), rel=0.05)
    assert set(sd.values()) == {None}
    assert body["drift"]["tilt_deg"] is None
    assert body["drift"]["angle_deg"] == pytest.approx(1.3, abs=0.01)
    assert "cannot tell tilt and height" in body["reason"]
    (alert,) = bench.alerts()
    assert (alert["kind"], alert["drift"]["tilt_deg"]) == ("drift", None)
    items = bench.http.get("/cameras/corner/pose/history").json()["items"]
    assert items[-1]["tilt_deg"] == pytest.approx(22.0)
    assert items[-1]["drift"]["height_m"] is None


def test_where_nothing_is_told_the_state_is_never_ok(bench):
    everything = ("tilt", "roll", "height")
    bench.see(PRIOR)
    assert bench.pose()["state"] == "ok"
    bench.see(moved(tilt_deg=5.0), unidentifiable=everything)
    body = bench.pose()
    assert (body["state"], body["estimated"]) == ("learning", [])
    assert (body["sd"], body["drift"]) == (None, None)
    problem(bench.http.post("/cameras/corner/pose/accept"), 409, "conflict")
    for _ in range(3):
        bench.see(moved(tilt_deg=5.0))
    for _ in range(4):
        bench.see(PRIOR, unidentifiable=everything)
    assert bench.pose()["state"] == "drifting"  # what is not told ends no alert
    (alert,) = bench.alerts(state="firing")
    assert alert["drift"]["tilt_deg"] == pytest.approx(5.0, abs=0.02)


def test_accepting_makes_the_served_pose_the_prior_and_begins_a_reference(bench):
    problem(bench.http.post("/cameras/corner/pose/accept"), 409, "conflict")
    for _ in range(3):
        bench.see(moved(tilt_deg=5.0))
    body = bench.http.post("/cameras/corner/pose/accept", json={"by": "Ada"}).json()
    assert body["state"] == "learning"
    assert (
        body["reason"] == "0 of 200 people for the reference"
    )  # the tracks so far led to the new pose
    assert body["reference"]["state"] == "learning"
    assert body["pose"]["tilt_deg"] == pytest.approx(27.0, abs=0.02)
    assert bench.alerts()[0]["outcome"] == "accepted"
    prior = bench.http.get("/cameras/corner").json()["prior_pose"]
    assert prior["tilt_deg"] == pytest.approx(27.0, abs=0.02)
    assert bench.trainings()[0]["state"] == "queued"
    bench.see(moved(tilt_deg=5.0), people=7)
    assert bench.pose()["reason"] == "7 of 200 people for the reference"
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
    assert {alert["kind"] for alert in bench.alerts()} == {"drift"}
    assert {(a["outcome"], a["resolved_by"]) for a in bench.alerts()} == {("relearned", "Ada")}
    bench.see(PRIOR, people=7)
    assert bench.pose()["reference"]["tracks"] == 7
    assert bench.http.post("/cameras/corner/reference/reset").status_code == 200  # no body needed
    problem(bench.http.post("/cameras/nowhere/reference/reset"), 404, "not_found")


def test_the_number_of_reference_tracks_can_change_while_they_are_awaited(corner):
    batch = [track(str(n), start_s=1_700_000_000.0 + n) for n in range(9)]
    corner.post("/cameras/corner/tracks", json={"tracks": batch})
    assert (
        corner.get("/cameras/corner/pose").json()["reason"] == "9 of 200 people for the reference"
    )
    change = {"reference_tracks": 50}
    corner.patch("/cameras/corner", json=change, headers={"If-Match": "*"}).raise_for_status()
    assert corner.get("/cameras/corner/pose").json()["reason"] == "9 of 50 people for the reference"


def test_other_tracks_are_wanted_after_another_pose_but_not_after_another_speed(corner):
    batch = [track(str(n), start_s=1_700_000_000.0 + n) for n in range(9)]
    corner.post("/cameras/corner/tracks", json={"tracks": batch})
    for change, left in (
        ({"walking_speed": {"mean_mps": 1.2}}, 9),
        ({"prior_pose": {"height_m": 5.0, "tilt_deg": 20.0}}, 0),
    ):
        corner.patch("/cameras/corner", json=change, headers={"If-Match": "*"}).raise_for_status()
        body = corner.get("/cameras/corner/pose").json()
        assert body["reason"] == f"{left} of 200 people for the reference"


def test_what_is_left_out_of_a_walking_speed_stays(corner):
    for change, kept in (
        ({"mean_mps": 1.2, "sd_mps": 0.3}, {"mean_mps": 1.2, "sd_mps": 0.3}),
        ({"mean_mps": 1.1}, {"mean_mps": 1.1, "sd_mps": 0.3}),
        ({"sd_mps": 0.2}, {"mean_mps": 1.1, "sd_mps": 0.2}),
        ({}, {"mean_mps": 1.1, "sd_mps": 0.2}),
    ):
        body = {"walking_speed": change}
        answer = corner.patch("/cameras/corner", json=body, headers={"If-Match": "*"})
        assert answer.json()["walking_speed"] == kept


def test_history_is_a_series_between_two_times(bench):
    for tilt_deg in (0.0, 0.5, 1.0):
        bench.see(moved(tilt_deg=tilt_deg), sd_deg=0.01)
    items = bench.http.get("/cameras/corner/pose/history").json()["items"]
    assert [round(item["tilt_deg"], 1) for item in items] == [22.0, 22.5, 23.0]
    late = bench.http.get("/cameras/corner/pose/history", params={"from": items[1]["at"]}).json()
    assert len(late["items"]) == 2
    newest = bench.http.get("/cameras/corner/pose/history", params={"limit": 1}).json()["items"]
    assert newest == items[-1:]
    bad = bench.http.get("/cameras/corner/pose/history", params={"from": "2026-01-01T00:00:00"})
    problem(bad, 422, "malformed")


def test_a_chart_gets_a_thinned_history_that_ends_with_the_newest(bench):
    for n in range(7):
        bench.see(moved(tilt_deg=0.1 * n), sd_deg=0.001)
    url = "/cameras/corner/pose/history"

    def tilts(**query):
        items = bench.http.get(url, params=query).json()["items"]
        return [round(item["tilt_deg"], 1) for item in items]

    assert tilts(points=7) == [22.0, 22.1, 22.2, 22.3, 22.4, 22.5, 22.6]
    assert tilts(points=4) == [22.0, 22.2, 22.4, 22.6]
    assert tilts(points=2) == [22.2, 22.6]
    problem(bench.http.get(url, params={"points": 2, "limit": 2}), 422, "malformed")
    problem(bench.http.get("/cameras/nowhere/pose/history?points=9"), 404, "not_found")


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
