"""What stands beside a camera's state: plans, silence, groups, alerts on its page."""

import re
from datetime import UTC, datetime, timedelta

from fastapi.testclient import TestClient

from service.alerts.alerts import open_alert
from service.app import create_app
from service.estimation.estimates import save_estimate
from service.estimation.evidence import load_evidence
from service.reasons import as_said
from service.store import alerts, references
from service.workers.upkeep import reconciliation
from tests.service.alerts.test_states import KNOCKED, at, knock, resolve, states, told_history
from tests.service.bench import PRIOR, made_up, moved


def test_a_plan_stays_as_it_was_when_it_ends_early(bench):
    url = "/cameras/corner/maintenance"
    window = bench.http.post(url, json={"to": at(2), "by": "Cy"}).json()
    planned = told_history(bench.http)
    bench.http.delete(f"{url}/{window['id']}").raise_for_status()
    (kept,) = bench.http.get(url).json()["items"]
    assert (kept["to"], kept["state"]) == (window["to"], "over")
    assert kept["ended_at"] < kept["to"]
    until = re.search(r"Cy planned maintenance until ([^.]+)\.", planned)[1]
    history = told_history(bench.http)
    assert f"Cy planned maintenance until {until}." in history
    assert f"ended the maintenance that was planned until {until}." in history


def test_the_end_of_maintenance_is_an_entry_of_its_own_once(bench):
    url = "/cameras/corner/maintenance"
    bench.http.post(url, json={"from": at(-1), "to": at(1)}).raise_for_status()
    with bench.store.write() as session:
        (window,) = references.maintenance_of(session, "corner")
        window.to_at = datetime.now(UTC) - timedelta(minutes=1)
    for _ in range(2):
        with bench.store.write() as session:
            reconciliation.reconcile_camera(session, bench.queue, bench.settings, "corner")
    items = bench.http.get("/activity").json()["items"]
    assert [e["what"] for e in items if e["what"].startswith("maintenance")] == [
        "maintenance.planned",
        "maintenance.over",
    ]
    assert "The maintenance is over." in told_history(bench.http)


def test_an_estimate_that_an_answer_overtakes_is_dropped(bench):
    bench.see(PRIOR)
    for _ in range(2):
        bench.see(KNOCKED)
    bench.see(KNOCKED)
    bench.post(1)
    with bench.store.read() as session:
        evidence = load_evidence(session, bench.settings, "corner")
    resolve(bench, "false_alarm")
    with bench.store.write() as session:
        finding = made_up(evidence, KNOCKED)
        assert save_estimate(session, bench.queue, bench.settings, evidence, finding) is None
    assert states(bench.http) == {"ok"}
    assert bench.alerts(state="firing") == []


def test_silence_does_not_hide_that_a_camera_has_moved(bench):
    knock(bench)
    quick = bench.settings.model_copy(update={"no_data_after_h": 0.5})
    with TestClient(create_app(quick)) as http:
        assert states(http) == {"drifting"}
        assert "the newest track ended" in http.get("/cameras/corner/pose").json()["reason"]


def test_an_alert_shows_on_its_page_however_many_came_after_it(bench):
    knock(bench)
    for _ in range(55):
        with bench.store.write() as session:
            alert = open_alert(
                session,
                bench.settings,
                "corner",
                "no_data",
                "warning",
                {},
                None,
                reasons=as_said("none"),
            )
            alert.state, alert.resolved_at, alert.outcome = "resolved", alert.opened_at, "cleared"
    (drift,) = bench.alerts(state="firing")
    text = bench.http.get("/ui/cameras/corner").text
    assert f'id="alert-{drift["id"]}"' in text


def test_events_say_what_was_done_so_that_pages_call_out_news_alone(bench):
    """Acknowledging and silencing were called out on every screen like a new alert."""
    for _ in range(3):
        bench.see(moved(tilt_deg=5.0))
    url = f"/alerts/{bench.alerts()[0]['id']}"
    bench.http.post(f"{url}/acknowledge").raise_for_status()
    bench.http.post(f"{url}/silence", json={"until": at(1)}).raise_for_status()
    bench.http.post(f"{url}/resolve", json={"outcome": "false_alarm"}).raise_for_status()
    told = [event["message"] for event in bench.events("alert")]
    assert told[0] == "alert.opened"
    assert told[-3:] == ["alert.acknowledged", "alert.silenced", "alert.resolved"]


def test_a_member_of_a_group_is_in_the_metrics(bench):
    knock(bench)
    with bench.store.write() as session:
        alert = alerts.firing(session, "corner", "drift")
        group = open_alert(
            session, bench.settings, "corner", "no_data", "warning", {}, None, reasons=as_said("x")
        )
        alert.group_id = group.id
    text = bench.http.get("/metrics").text
    assert 'surefoot_alert_firing{camera_id="corner",kind="drift"} 1.0' in text
    assert 'surefoot_alert_grouped{camera_id="corner",kind="drift"} 1.0' in text
