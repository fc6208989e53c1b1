"""An answer is taken back within some minutes: everything is as it was before it."""

from datetime import timedelta

import pytest

from service.alerts.alerts import open_alert
from service.cameras import undo
from service.enums import AlertSource
from service.reasons import as_said
from service.store import references
from tests.conftest import CAMERA
from tests.service.alerts.test_states import knock, resolve, states, told_history
from tests.service.bench import PRIOR, moved
from tests.service.conftest import problem

URL = "/cameras/corner/pose/undo"


def picture(bench):
    """All that clients are told of the camera, without what says when."""
    zones = bench.http.get("/cameras/corner/zones").json()
    alerts = [{k: v for k, v in a.items() if k != "updated_at"} for a in bench.alerts()]
    return bench.pose(), alerts, bench.http.get("/cameras/corner").json()["prior_pose"], zones


def accept(bench):
    bench.http.post("/cameras/corner/pose/accept", json={"by": "Ada"}).raise_for_status()


def put_back(bench):
    bench.http.post("/cameras/corner/pose/put-back", json={"by": "Ada"}).raise_for_status()


def relearn(bench):
    bench.http.post("/cameras/corner/reference/reset", json={"by": "Ada"}).raise_for_status()


def false_alarm(bench):
    resolve(bench, "false_alarm")


@pytest.mark.parametrize("answer", [accept, put_back, relearn, false_alarm])
@pytest.mark.parametrize("people", [0, 8])
def test_all_is_as_it_was(bench, answer, people):
    knock(bench)
    (firing,) = bench.alerts(state="firing")
    bench.http.post(f"/alerts/{firing['id']}/acknowledge", json={"by": "Bo"}).raise_for_status()
    door = {"id": "door", "on": "ground", "points": [[300, 400], [500, 410], [480, 600]]}
    bench.http.put(
        "/cameras/corner/zones", json={"zones": [door]}, headers={"If-Match": "*"}
    ).raise_for_status()
    before = picture(bench)
    answer(bench)
    assert bench.alerts(state="firing") == []
    if people:  # who come between change nothing that stays
        bench.see(PRIOR, people=people)
    bench.http.post(URL, json={"by": "Ada"}).raise_for_status()
    assert picture(bench) == before
    assert states(bench.http) == {"drifting"}
    log = told_history(bench.http)
    assert "Ada undid the last answer." in log
    assert "opened the alert “the camera moved” again" in log
    problem(bench.http.post(URL), 409, "conflict")  # once
    # And it goes on from there: people tell that it was put right after all.
    for _ in range(2):
        bench.see(PRIOR)
    assert bench.alerts(state="firing") == []


def test_receivers_are_told_that_the_alert_fires_again(bench):
    knock(bench)
    false_alarm(bench)
    bench.http.post(URL).raise_for_status()
    assert [event["state"] for event in bench.events("alert")][-2:] == ["resolved", "firing"]


def test_a_mended_clock_is_taken_back(bench):
    bench.see(PRIOR)
    for _ in range(3):
        bench.see(moved(height_m=1.32))
    before = picture(bench)
    resolve(bench, "fixed")
    bench.http.post(URL).raise_for_status()
    assert picture(bench) == before


def test_a_reference_that_a_put_back_began_is_taken_back(bench):
    with bench.store.write() as session:
        reference = references.newest(session, "corner")
        reference.doubts, was = as_said("people walk at 3 m/s"), reference.id
        open_alert(
            session, bench.settings, "corner", "drift", "warning", {}, None,
            reasons=as_said("people walk at 3 m/s"), source=AlertSource.REFERENCE,
        )  # fmt: skip
    put_back(bench)
    bench.http.post(URL).raise_for_status()
    with bench.store.read() as session:
        assert references.newest(session, "corner").id == was
    assert len(bench.alerts(state="firing")) == 1


def test_not_for_long_and_not_past_what_was_said_or_told_since(bench, monkeypatch):
    problem(bench.http.post(URL), 409, "conflict")  # nobody has answered
    knock(bench)
    put_back(bench)
    for _ in range(3):  # people tell that it was not
        bench.see(moved(tilt_deg=6.6))
    assert len(bench.alerts(state="firing")) == 1
    problem(bench.http.post(URL), 409, "conflict")
    put_back(bench)
    body = {"prior_pose": {"height_m": 6.1, "tilt_deg": 22.0}}
    bench.http.patch("/cameras/corner", json=body, headers={"If-Match": "*"}).raise_for_status()
    problem(bench.http.post(URL), 409, "conflict")
    put_back(bench)
    monkeypatch.setattr(undo, "UNDO_WITHIN", timedelta(0))
    problem(bench.http.post(URL), 409, "conflict")


def test_an_answer_about_the_camera_that_had_the_id_before_is_none_of_this_one(bench):
    put_back(bench)
    headers = {"If-Match": "*"}
    bench.http.delete("/cameras/corner", headers=headers).raise_for_status()
    bench.http.post("/cameras", json=CAMERA).raise_for_status()
    problem(bench.http.post(URL), 409, "conflict")
    many = bench.http.post("/actions", json={"action": "undo", "ids": ["corner"]})
    assert many.status_code == 200
