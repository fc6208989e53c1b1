"""Silences of alerts, their end, and the history of who did what."""

from datetime import UTC, datetime, timedelta

import pytest

from service.store import alerts
from service.workers.upkeep import reconciliation
from tests.service.bench import PRIOR, moved
from tests.service.conftest import problem


def in_hours(hours):
    return (datetime.now(UTC) + timedelta(hours=hours)).isoformat()


@pytest.fixture
def drifting(bench):
    """The bench with an open drift alert, a warning."""
    for _ in range(3):
        bench.see(moved(tilt_deg=1.5))
    bench.url = f"/alerts/{bench.alerts()[0]['id']}"
    return bench


def silence(bench, **body):
    return bench.http.post(f"{bench.url}/silence", json=body)


def test_a_silence_stands_in_the_alert_and_its_event(drifting):
    until = in_hours(2)
    body = silence(drifting, until=until, reason="scaffolding", by="Ada").json()
    assert datetime.fromisoformat(body["silenced_until"]) == datetime.fromisoformat(until)
    assert (body["silenced"], body["silence_reason"], body["silenced_by"]) == (
        True,
        "scaffolding",
        "Ada",
    )
    assert (body["state"], body["acknowledged"]) == ("firing", False)
    event = drifting.events("alert")[-1]
    assert datetime.fromisoformat(event["silenced_until"]) == datetime.fromisoformat(until)
    assert (event["silence_reason"], event["silenced_by"]) == ("scaffolding", "Ada")


def test_a_later_silence_replaces_the_first_and_null_ends_it(drifting):
    silence(drifting, until=in_hours(2), reason="scaffolding", by="Ada").raise_for_status()
    body = silence(drifting, until=in_hours(1), by="Bob").json()
    assert (body["silence_reason"], body["silenced_by"]) == (None, "Bob")
    assert datetime.fromisoformat(body["silenced_until"]) < datetime.now(UTC) + timedelta(hours=1.1)
    body = silence(drifting, until=None, by="Eve").json()
    assert (body["silenced"], body["silenced_until"], body["silenced_by"]) == (False, None, None)
    told = len(drifting.events("alert"))
    silence(drifting, until=None).raise_for_status()  # there is none: nothing happens
    assert len(drifting.events("alert")) == told
    acts = drifting.http.get(drifting.url).json()["acts"]
    assert [(act["action"], act["by"]) for act in acts] == [
        ("silenced", "Ada"),
        ("silenced", "Bob"),
        ("silence_ended", "Eve"),
    ]


@pytest.mark.parametrize(
    ("until", "words"),
    [
        (in_hours(-0.1), "a time after now"),
        (in_hours(30 * 24 + 1), "at most 30 days"),
        ("2030-01-01T00:00:00", "with a zone"),
        ("soon", "RFC 3339"),
    ],
    ids=["past", "far", "naive", "words"],  # a time of now in a name differs between processes
)
def test_a_silence_needs_a_time_ahead_and_not_too_far(drifting, until, words):
    document = problem(silence(drifting, until=until), 422, "malformed")
    assert document["errors"][0]["pointer"] == "/until"
    assert words in document["errors"][0]["reason"]
    problem(silence(drifting, reason="no time at all"), 422, "malformed")
    assert drifting.alerts()[0]["silenced_until"] is None


def test_only_an_open_alert_takes_a_silence(drifting):
    problem(drifting.http.post("/alerts/none/silence", json={"until": None}), 404, "not_found")
    for _ in range(3):
        drifting.see(PRIOR)
    problem(silence(drifting, until=in_hours(1)), 409, "conflict")


def test_a_silenced_alert_that_grows_stays_silenced_and_says_so(drifting):
    silence(drifting, until=in_hours(2), by="Ada").raise_for_status()
    drifting.see(moved(tilt_deg=5.0))
    body = drifting.http.get(drifting.url).json()
    assert (body["severity"], body["silenced"]) == ("critical", True)
    event = drifting.events("alert")[-1]
    assert (event["severity"], event["silenced_by"]) == ("critical", "Ada")
    last = body["acts"][-1]
    assert (last["action"], last["by"]) == ("grew", None)


def test_a_silence_that_has_come_to_its_time_is_told_of_once(drifting):
    silence(drifting, until=in_hours(2), reason="scaffolding", by="Ada").raise_for_status()
    with drifting.store.write() as session:
        reconciliation.reconcile_alerts(session)
    assert drifting.alerts(silenced="true")
    with drifting.store.write() as session:
        record = alerts.firing(session, "corner", "drift")
        record.silenced_until = datetime.now(UTC) - timedelta(seconds=1)
    assert drifting.alerts(silenced="true") == []
    told = len(drifting.events("alert"))
    for _ in range(2):
        with drifting.store.write() as session:
            reconciliation.reconcile_alerts(session)
    (event,) = drifting.events("alert")[told:]
    assert (event["state"], event["silenced_until"]) == ("firing", None)
    body = drifting.http.get(drifting.url).json()
    assert (body["silence_reason"], body["acts"][-1]["action"]) == (None, "silence_ended")
    assert body["acts"][-1]["by"] is None


def test_alerts_are_found_by_their_flags(drifting):
    assert len(drifting.alerts(silenced="false", acknowledged="false")) == 1
    assert drifting.alerts(silenced="true") == drifting.alerts(acknowledged="true") == []
    silence(drifting, until=in_hours(2)).raise_for_status()
    drifting.http.post(f"{drifting.url}/acknowledge").raise_for_status()
    assert len(drifting.alerts(silenced="true", acknowledged="true")) == 1
    assert drifting.alerts(silenced="false") == drifting.alerts(acknowledged="false") == []


def test_what_was_done_is_kept_with_who_and_when(drifting):
    before = datetime.now(UTC)
    drifting.http.post(f"{drifting.url}/acknowledge", json={"by": "Ada"})
    drifting.http.post(f"{drifting.url}/acknowledge", json={"by": "Bob"})  # the first one stays
    answer = {"outcome": "false_alarm", "note": "a parade", "by": "Eve"}
    drifting.http.post(f"{drifting.url}/resolve", json=answer).raise_for_status()
    seen, resolved = drifting.http.get(drifting.url).json()["acts"]
    assert (seen["action"], seen["by"], seen["outcome"]) == ("acknowledged", "Ada", None)
    assert resolved | {"at": ""} == {
        "at": "",
        "action": "resolved",
        "by": "Eve",
        "until": None,
        "outcome": "false_alarm",
        "note": "a parade",
    }
    assert before <= datetime.fromisoformat(seen["at"]) <= datetime.fromisoformat(resolved["at"])


def test_what_ends_by_itself_is_in_the_history_without_a_name(drifting):
    for _ in range(3):
        drifting.see(PRIOR)
    (act,) = drifting.http.get(drifting.url).json()["acts"]
    assert (act["action"], act["outcome"], act["by"]) == ("resolved", "cleared", None)


def test_acts_go_with_their_camera(drifting):
    drifting.http.post(f"{drifting.url}/acknowledge").raise_for_status()
    drifting.http.delete("/cameras/corner", headers={"If-Match": "*"}).raise_for_status()
    problem(drifting.http.get(drifting.url), 404, "not_found")


def test_put_back_by_resolving_holds_the_camera_to_its_reference_by_new_tracks(bench):
    far = moved(tilt_deg=14.0)
    for _ in range(3):
        bench.see(far)
    drift = next(alert for alert in bench.alerts() if alert["kind"] == "drift")
    answer = {"outcome": "put_back", "by": "Ada"}
    bench.http.post(f"/alerts/{drift['id']}/resolve", json=answer).raise_for_status()
    # As by a reset, all that held the camera against its prior pose ends ...
    assert {alert["kind"] for alert in bench.alerts()} == {"drift"}
    assert {(a["outcome"], a["resolved_by"]) for a in bench.alerts()} == {("put_back", "Ada")}
    body = bench.pose()
    assert (body["state"], body["estimated"]) == ("learning", [])
    assert "0 tracks since the camera was put back" in body["reason"]
    # ... but what was learned of it holds, and tracks of before say nothing any more.
    assert body["reference"]["state"] == "ready"
    assert bench.see(PRIOR, people=4) is None
    record = bench.see(PRIOR, people=4)
    assert (record.state, record.tracks) == ("ok", 8)


def test_a_camera_that_was_not_put_back_after_all_alarms_anew(bench):
    for _ in range(3):
        bench.see(moved(tilt_deg=5.0))
    url = f"/alerts/{bench.alerts()[0]['id']}/resolve"
    bench.http.post(url, json={"outcome": "put_back"}).raise_for_status()
    bench.see(moved(tilt_deg=5.0), people=8)
    assert bench.alerts(state="firing") == []
    bench.see(moved(tilt_deg=5.0), people=8)
    (alert,) = bench.alerts(state="firing")
    resolved = next(alert for alert in bench.alerts() if alert["state"] == "resolved")
    assert datetime.fromisoformat(alert["changed_at"]) > datetime.fromisoformat(
        resolved["changed_at"]
    )


@pytest.mark.parametrize("outcome", ["put_back", "false_alarm"])
def test_no_answer_makes_a_new_reference_by_itself(bench, outcome):
    for _ in range(3):
        bench.see(moved(tilt_deg=5.0))
    before = bench.http.get("/cameras/corner").json()["prior_pose"]
    url = f"/alerts/{bench.alerts()[0]['id']}/resolve"
    bench.http.post(url, json={"outcome": outcome}).raise_for_status()
    assert bench.http.get("/cameras/corner").json()["prior_pose"] == before
    assert bench.pose()["reference"]["state"] == "ready"
