"""What drifts come to: alerts, their clearing, and the training that a far pose asks for."""

from datetime import datetime, timedelta

import pytest

from models.pose import Cause
from service.store import references
from service.training import begin_training, end_training
from tests.service.bench import PRIOR, moved
from tests.service.conftest import problem


def test_a_drift_fires_once_it_is_certain_and_is_one_alert(bench):
    knocked = moved(tilt_deg=5.0)
    assert bench.see(PRIOR).state == "ok"
    for _ in range(5):  # a freak hour, looked at time and again
        assert bench.see(knocked, sd_deg=1.1).state == "suspected"
    assert bench.alerts() == []
    assert "which is not sure enough for an alert" in bench.pose()["reason"]
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
        bench.see(moved(tilt_deg=0.9), sd_deg=0.05)  # it certainly moved, and by too little
    assert bench.pose()["moved"] > 0.99
    assert bench.pose()["state"] == "suspected"
    for _ in range(5):
        bench.see(moved(tilt_deg=2.0), sd_deg=1.0)  # which people do without any move
    assert bench.pose()["state"] == "ok"
    assert bench.alerts() == []


def test_an_alert_clears_with_hysteresis(bench):
    for _ in range(3):
        bench.see(moved(tilt_deg=1.5))
    for _ in range(4):
        bench.see(moved(tilt_deg=0.8), sd_deg=0.1)  # below the floor of 1 deg, not 0.7 of it
    assert len(bench.alerts(state="firing")) == 1
    assert "it ends once a move is unlikely" in bench.pose()["reason"]
    bench.see(moved(tilt_deg=0.6), sd_deg=0.05)
    (alert,) = bench.alerts()
    assert (alert["state"], alert["outcome"]) == ("resolved", "cleared")
    assert bench.pose()["state"] == "suspected"
    bench.see(PRIOR)
    assert bench.pose()["state"] == "ok"


def test_a_far_move_queues_one_training_around_the_estimate(bench):
    far = moved(tilt_deg=14.0)
    for _ in range(4):
        bench.see(far)
    body = bench.pose()
    assert body["state"] == "drifting"
    assert body["pose"]["tilt_deg"] == pytest.approx(36.0, abs=0.02)
    assert [alert["kind"] for alert in bench.alerts(state="firing")] == ["drift"]
    queued, first = bench.trainings()
    assert (queued["state"], first["state"], first["around"]) == ("queued", "succeeded", None)
    assert queued["around"]["tilt_deg"] == pytest.approx(36.0, abs=0.02)
    plan = bench.publish()
    assert plan.prior_pose.tilt_rad == pytest.approx(far.tilt_rad, abs=4e-4)
    assert plan.prior_pose.heading_rad == PRIOR.heading_rad
    bench.see(far)
    assert bench.pose()["state"] == "drifting"
    assert [alert["kind"] for alert in bench.alerts(state="firing")] == ["drift"]
    assert len(bench.trainings()) == 2


def test_a_pan_alone_fires_and_clears_as_any_drift(bench):
    for _ in range(3):
        bench.see(moved(heading_deg=-5.0), paths=True)
    (alert,) = bench.alerts(state="firing")
    assert (alert["kind"], alert["severity"]) == ("drift", "critical")
    assert alert["drift"]["heading_deg"] == pytest.approx(-5.0, abs=0.05)
    assert alert["drift"]["angle_deg"] == pytest.approx(5.0, abs=0.5)
    assert "heading -5.00 deg" in alert["reason"]
    assert alert["reason_code"] == "beyond_limits"
    assert alert["reason_values"]["heading_deg"] == pytest.approx(-5.0, abs=0.05)
    assert alert["reason_values"]["floor_deg"] == pytest.approx(1.0)
    for _ in range(4):
        bench.see(PRIOR)  # by speeds alone: they cannot tell that it was turned back
    assert len(bench.alerts(state="firing")) == 1
    for _ in range(3):
        bench.see(PRIOR, paths=True)
    assert bench.alerts(state="firing") == []


def test_a_pan_asks_for_no_training(bench):
    bench.see(moved(tilt_deg=14.0), paths=True)
    with bench.store.write() as session:
        attempt = begin_training(session, bench.settings, bench.trainings()[0]["id"])
        end_training(session, attempt, "failed", "no walk is possible")
    bench.see(moved(tilt_deg=14.0, heading_deg=25.0), paths=True)
    assert len(bench.trainings()) == 2


def test_a_training_around_the_estimate_that_failed_is_not_queued_again(bench):
    bench.see(moved(tilt_deg=14.0))
    with bench.store.write() as session:
        attempt = begin_training(session, bench.settings, bench.trainings()[0]["id"])
        end_training(session, attempt, "failed", "no walk is possible")
    bench.see(moved(tilt_deg=14.1))
    assert len(bench.trainings()) == 2
    bench.see(moved(tilt_deg=14.1, height_m=2.8))  # another pose: more than a metre away
    assert len(bench.trainings()) == 3


def test_an_alert_ends_only_where_what_drifted_is_told_again(bench):
    for _ in range(3):
        bench.see(moved(tilt_deg=5.0))
    for _ in range(5):
        bench.see(PRIOR, unidentifiable=("tilt",))
    assert len(bench.alerts(state="firing")) == 1
    for _ in range(3):
        bench.see(PRIOR, unidentifiable=("roll",))
    assert bench.alerts(state="firing") == []


def test_a_jump_in_scale_alone_is_named_a_clock_fault(bench):
    for _ in range(3):
        bench.see(moved(height_m=1.2))
    body = bench.pose()
    assert body["state"] == "drifting"
    assert "as if 30 frames a second were taken for 25" in body["reason"]
    (alert,) = bench.alerts()
    assert (alert["kind"], alert["state"]) == ("clock", "firing")
    assert alert["drift"]["height_m"] == pytest.approx(1.2, abs=0.02)
    assert "+20 %" in alert["reason"]
    for _ in range(3):
        bench.see(PRIOR)
    assert [alert["outcome"] for alert in bench.alerts()] == ["cleared"]


def clock_of(probability, factor):
    """The causes of a window: a clock so likely wrong, and a lens that is not."""
    return (
        Cause(probability=probability, factor=factor),
        Cause(probability=0.01, factor=1.04),
    )


def test_a_wrong_clock_before_a_camera_that_stands_is_told_until_it_is_right(bench):
    bench.see(PRIOR, paths=True, causes=clock_of(0.98, 1.2))
    assert bench.alerts() == []
    bench.see(PRIOR, paths=True, causes=clock_of(0.995, 1.2))
    (alert,) = bench.alerts()
    assert (alert["kind"], alert["state"]) == ("clock", "firing")
    assert "as if 30 frames a second were taken for 25" in alert["reason"]
    assert bench.pose()["state"] == "drifting"
    assert "beyond" not in bench.pose()["reason"]
    bench.see(PRIOR, paths=True, causes=clock_of(0.6, 1.15))
    assert len(bench.alerts(state="firing")) == 1
    bench.see(PRIOR, paths=True, causes=clock_of(0.1, 1.02))
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
    # The person before walked on for some seconds beside the first one after it.
    since = [datetime.fromisoformat(alert["since"][end]).timestamp() for end in ("after", "before")]
    assert since == pytest.approx([first, first - 1 + 0.4 * 19])
    assert alert["changed_at"] == alert["since"]["before"]
    body = bench.pose()
    assert datetime.fromisoformat(body["from"]).timestamp() >= first


def test_an_alert_has_no_time_until_enough_people_came_after_the_move(bench):
    bench.see(PRIOR)
    for _ in range(2):
        bench.see(moved(tilt_deg=5.0), change=4, timed=False)
    (alert,) = bench.alerts(state="firing")
    assert (alert["changed_at"], alert["since"]) == (None, {"after": None, "before": None})
    assert bench.pose()["since"] == {"after": None, "before": None}
    bench.see(moved(tilt_deg=5.0))
    (alert,) = bench.alerts(state="firing")
    after, before = (alert["since"][end] for end in ("after", "before"))
    assert after < before == alert["changed_at"]


def test_an_alert_of_before_a_reference_ends_by_what_is_seen_after_it_alone(bench):
    for _ in range(3):
        bench.see(moved(tilt_deg=5.0))
    change = {"walking_speed": {"mean_mps": 1.3}}
    bench.http.patch("/cameras/corner", json=change, headers={"If-Match": "*"}).raise_for_status()
    for _ in range(4):
        bench.see(PRIOR)  # while the reference is learned again
    bench.learn()
    for _ in range(3):
        bench.see(PRIOR, unidentifiable=("tilt",))  # what had drifted has to be told to end
    assert len(bench.alerts(state="firing")) == 1
    bench.see(PRIOR)
    assert bench.alerts(state="firing") == []


def test_a_camera_that_was_never_seen_at_its_prior_pose_had_moved_before(bench):
    bench.http.post("/cameras/corner/reference/reset").raise_for_status()
    bench.see(PRIOR, people=7)
    bench.learn()
    for _ in range(3):
        bench.see(moved(tilt_deg=5.0))
    (alert,) = bench.alerts()
    first_started_s = bench.clock_s - 2 * 60
    since = datetime.fromisoformat(alert["changed_at"]).timestamp()
    assert since == pytest.approx(first_started_s)


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
    bench.see(moved(roll_deg=-4.0), people=6)
    assert bench.alerts(state="firing") == []  # a dozen new people have to say it anew
    bench.see(moved(roll_deg=-4.0), people=6)
    assert len(bench.alerts(state="firing")) == 1


def test_who_acknowledged_by_mistake_gives_it_back(bench):
    """An alert that nobody looked after was silent for good: it neither waited nor escalated."""
    for _ in range(3):
        bench.see(moved(roll_deg=-4.0))
    url = f"/alerts/{bench.alerts()[0]['id']}"
    bench.http.post(f"{url}/acknowledge", json={"by": "Ada"}).raise_for_status()
    assert bench.alerts(acknowledged=False) == []
    assert "Give back" in bench.http.get("/ui/alerts").text
    for by in ("Ada", "Bob"):  # the second time nothing happens
        back = bench.http.post(f"{url}/acknowledge", json={"by": by, "acknowledged": False}).json()
        assert (back["acknowledged"], back["acknowledged_by"]) == (False, None)
    assert [(act["action"], act["by"]) for act in back["acts"]][-2:] == [
        ("acknowledged", "Ada"),
        ("given_back", "Ada"),
    ]
    assert bench.events("alert")[-1]["acknowledged_by"] is None
    assert len(bench.alerts(acknowledged=False)) == 1
    assert "Give back" not in bench.http.get("/ui/alerts").text


def test_another_prior_pose_ends_the_alert_against_the_old_one(bench):
    for _ in range(3):
        bench.see(moved(tilt_deg=5.0))
    change = {"prior_pose": {"height_m": 6.0, "tilt_deg": 27.0, "roll_deg": 1.0}}
    bench.http.patch("/cameras/corner", json=change, headers={"If-Match": "*"}).raise_for_status()
    assert [alert["outcome"] for alert in bench.alerts()] == ["accepted"]
    assert bench.pose()["estimated"] == []  # what was measured against the old one is gone
