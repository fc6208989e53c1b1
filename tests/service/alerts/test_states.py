"""Pages, API, metrics and alerts say the same of a camera, whatever was done to it."""

import html
import re
from datetime import UTC, datetime, timedelta
from zoneinfo import ZoneInfo

import pytest
from fastapi.testclient import TestClient
from prometheus_client.parser import text_string_to_metric_families as families

from service.alerts.alerts import open_alert
from service.app import create_app
from service.enums import AlertSource
from service.reasons import as_said
from service.store import references
from tests.conftest import CAMERA
from tests.service.bench import PRIOR, moved
from tests.service.conftest import problem

KNOCKED = moved(tilt_deg=6.6)


def at(hours):
    return (datetime.now(UTC) + timedelta(hours=hours)).isoformat()


def fleet_row(http):
    text = http.get("/").text
    row = text.split('id="row-corner"')[1].split("</li>")[0]
    return html.unescape(re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", row)))


def moved_count(http):
    return int(re.search(r"<b>(\d+)</b> Moved", http.get("/").text)[1])


def headline(http):
    text = http.get("/ui/cameras/corner").text
    return html.unescape(re.search(r'<p class="headline">(.*?)</p>', text, re.S)[1])


def metric_states(http):
    return {
        sample.labels["state"]
        for family in families(http.get("/metrics").text)
        for sample in family.samples
        if sample.name == "surefoot_camera_state" and sample.value == 1
    }


def states(http):
    """What each place says that the state is; one word where they agree."""
    page = http.get("/ui/cameras/corner").text
    row = re.search(r'<li class="row (\w+)" id="row-corner"', http.get("/").text)[1]
    shown = re.search(r'<section class="summary (\w+)"', page)[1]
    assert row == shown
    return {
        http.get("/cameras/corner/pose").json()["state"],
        # Pages call a wrong clock a clock, and no move.
        "drifting" if row == "clock" else row,
        *metric_states(http),
    }


def knock(bench):
    bench.see(PRIOR)
    for _ in range(3):
        bench.see(KNOCKED)
    assert states(bench.http) == {"drifting"}


def resolve(bench, outcome, **more):
    (alert, *_) = bench.alerts(state="firing")
    body = {"outcome": outcome, "by": "Ada", **more}
    bench.http.post(f"/alerts/{alert['id']}/resolve", json=body).raise_for_status()


def told_history(http):
    text = http.get("/ui/cameras/corner").text
    return html.unescape(text.split('id="log-title"')[1])


def test_maintenance_does_not_hide_a_camera_that_has_moved(bench):
    knock(bench)
    before = bench.pose()
    url = "/cameras/corner/maintenance"
    window = bench.http.post(url, json={"to": at(1)}).json()
    assert states(bench.http) == {"drifting"}
    assert bench.http.delete(f"{url}/{window['id']}").status_code == 204
    assert len(bench.alerts(state="firing")) == 1
    assert states(bench.http) == {"drifting"}
    assert moved_count(bench.http) == 1
    body = bench.pose()
    assert body["pose"] == before["pose"]
    assert body["estimated"] == ["height_m", "tilt_deg", "roll_deg"]
    assert "when it was last told" in body["reason"]
    assert "0 tracks since the maintenance" in body["reason"]
    assert "turned 6.6° (tilt +6.6°) when it was last told" in fleet_row(bench.http)
    assert "turned 6.6°" in headline(bench.http)
    assert "the next people will tell how it stands now" in headline(bench.http)


def test_people_after_the_maintenance_tell_that_it_was_put_right(bench):
    knock(bench)
    url = "/cameras/corner/maintenance"
    window = bench.http.post(url, json={"to": at(1)}).json()
    bench.http.delete(f"{url}/{window['id']}").raise_for_status()
    bench.clock_s = datetime.now(UTC).timestamp() - 55  # people come a minute later
    bench.see(PRIOR)
    assert bench.alerts(state="firing") == []
    assert states(bench.http) == {"ok"}


def test_after_a_false_alarm_it_is_ok_until_judged_anew(bench):
    knock(bench)
    resolve(bench, "false_alarm", note="a parade")
    assert states(bench.http) == {"ok"}
    assert moved_count(bench.http) == 0
    body = bench.pose()
    assert (body["estimated"], body["drift"]) == ([], None)
    assert body["pose"]["tilt_deg"] == pytest.approx(22.0)
    assert "0 tracks since the alert was called a false alarm" in body["reason"]
    assert "turned" not in fleet_row(bench.http)
    assert headline(bench.http) == "Where it should be, as Ada said. The next people will tell."
    assert not [s for s in bench.http.get("/metrics").text.splitlines() if "drift_radians{" in s]
    bench.see(PRIOR)
    assert states(bench.http) == {"ok"}
    assert headline(bench.http).startswith("Standing where it should")


def test_what_was_seen_before_a_false_alarm_alarms_no_more_but_what_comes_does(bench):
    knock(bench)
    resolve(bench, "false_alarm")
    for _ in range(4):
        bench.see(KNOCKED, people=1)
        assert states(bench.http) == {"ok"}
    for _ in range(3):
        bench.see(KNOCKED)
    assert states(bench.http) == {"drifting"}
    assert len(bench.alerts(state="firing")) == 1


def test_a_false_alarm_is_said_of_all_alerts_about_the_pose(bench):
    for _ in range(3):
        bench.see(moved(tilt_deg=14.0))
    with bench.store.write() as session:
        words = as_said("its people walk too fast")
        open_alert(session, bench.settings, "corner", "clock", "warning", {}, None, reasons=words)
    assert len(bench.alerts(state="firing")) == 2
    resolve(bench, "false_alarm")
    assert bench.alerts(state="firing") == []
    assert states(bench.http) == {"ok"}


def by_button(bench):
    bench.http.post("/cameras/corner/pose/put-back", json={"by": "Ada"}).raise_for_status()


def by_resolving(bench):
    resolve(bench, "put_back")


@pytest.mark.parametrize("put_back", [by_button, by_resolving])
def test_put_back_is_one_thing_however_it_is_said(bench, put_back):
    knock(bench)
    put_back(bench)
    assert {(a["outcome"], a["resolved_by"]) for a in bench.alerts()} == {("put_back", "Ada")}
    body = bench.pose()
    assert body["reference"]["state"] == "ready"
    assert (body["state"], body["estimated"]) == ("learning", [])
    assert "0 tracks since the camera was put back" in body["reason"]
    assert states(bench.http) == {"learning"}
    assert "Ada said that it was put back." in told_history(bench.http)
    bench.see(PRIOR)
    assert states(bench.http) == {"ok"}


def test_the_page_offers_put_back_and_learning_anew_as_what_they_are(bench):
    text = bench.http.get("/ui/cameras/corner").text
    put_back = text.split('data-action="put-back"')[1].split("</div>")[0]
    assert "What was learned there stays" in put_back
    relearn = text.split('data-action="relearn"')[1].split("</div>")[0]
    assert "a new reference of 200 people begins" in relearn


def test_a_camera_put_back_while_it_is_learned_is_learned_of_people_who_come_then(bench):
    bench.http.post("/cameras/corner/reference/reset").raise_for_status()
    bench.see(KNOCKED, people=7)
    assert bench.pose()["reference"]["tracks"] == 7
    by_button(bench)
    assert bench.pose()["reference"] | {"walking_speed_mps": 0} == {
        "state": "learning", "tracks": 0, "counted": 0, "pieces": 0, "hours": 0, "wanted": 200,
        "walking_speed_mps": 0,
    }  # fmt: skip


def test_a_camera_put_back_whose_reference_is_in_doubt_is_learned_anew(bench):
    with bench.store.write() as session:
        references.newest(session, "corner").doubts = as_said("people walk at 3 m/s")
        open_alert(
            session, bench.settings, "corner", "drift", "warning", {}, None,
            reasons=as_said("people walk at 3 m/s"), source=AlertSource.REFERENCE,
        )  # fmt: skip
    resolve(bench, "put_back")
    assert bench.pose()["reference"]["state"] == "learning"


def test_an_alert_of_a_reference_in_doubt_shows_on_a_camera_that_is_ok(bench):
    bench.see(PRIOR)
    with bench.store.write() as session:
        open_alert(
            session, bench.settings, "corner", "clock", "warning", {}, None,
            reasons=as_said("people walk at 3 m/s"), source=AlertSource.REFERENCE,
        )  # fmt: skip
    assert states(bench.http) == {"ok"}
    assert "alert: the clock looks wrong" in fleet_row(bench.http)
    assert headline(bench.http) == "It may not stand where it should: people walk at 3 m/s."


def test_accepting_by_resolving_accepts_the_pose(bench):
    knock(bench)
    resolve(bench, "accepted", note="new mast")
    assert bench.http.get("/cameras/corner").json()["prior_pose"]["tilt_deg"] == pytest.approx(
        28.6, abs=0.02
    )
    assert states(bench.http) == {"learning"}
    (alert,) = bench.alerts()
    assert (alert["outcome"], alert["note"]) == ("accepted", "new mast")


def test_a_page_says_times_by_the_zone_of_the_service(settings):
    """ "Why" said 22:54Z on a page that was of Copenhagen, and Access was in UTC."""
    with TestClient(create_app(settings.model_copy(update={"timezone": "Asia/Tokyo"}))) as http:
        http.post("/cameras", json=CAMERA).raise_for_status()
        to = datetime.now(UTC) + timedelta(hours=2)
        body = {"to": to.isoformat()}
        http.post("/cameras/corner/maintenance", json=body).raise_for_status()
        page = http.get("/ui/cameras/corner").text
        local = to.astimezone(ZoneInfo("Asia/Tokyo"))
        assert f"maintenance is under way until {local:%Y-%m-%d %H:%M}" in page
        assert f"{to:%H:%M}Z" not in page
        http.post("/tokens", json={"name": "Ada", "scopes": ["read"]}).raise_for_status()
        access = http.get("/ui/tokens").text
        assert "Times are Asia/Tokyo" in access
        assert f"{datetime.now(ZoneInfo('Asia/Tokyo')):%Y-%m-%d %H:}" in access


def test_there_is_no_accepting_where_nothing_is_told(bench):
    with bench.store.write() as session:
        open_alert(
            session, bench.settings, "corner", "clock", "warning", {}, None,
            reasons=as_said("3 m/s"), source=AlertSource.REFERENCE,
        )  # fmt: skip
    url = f"/alerts/{bench.alerts()[0]['id']}/resolve"
    problem(bench.http.post(url, json={"outcome": "accepted"}), 422, "malformed")
    assert len(bench.alerts(state="firing")) == 1


@pytest.fixture
def clocked(bench):
    """A camera whose people seem to walk at another speed, and so at another height."""
    bench.see(PRIOR)
    for _ in range(3):
        bench.see(moved(height_m=1.32))
    assert [alert["kind"] for alert in bench.alerts(state="firing")] == ["clock"]
    return bench


def test_a_clock_fault_makes_no_false_height_the_pose(clocked):
    """It did: 1.32 m too high, by "accept"; an alert's outcomes are those of its kind."""
    (alert,) = clocked.alerts(state="firing")
    url = f"/alerts/{alert['id']}/resolve"
    for outcome in ("accepted", "put_back"):
        said = problem(clocked.http.post(url, json={"outcome": outcome}), 422, "malformed")
        assert said["errors"][0]["pointer"] == "/outcome"
        assert "fixed or false_alarm" in said["detail"]
    problem(clocked.http.post("/cameras/corner/pose/accept"), 409, "conflict")
    assert clocked.http.get("/cameras/corner").json()["prior_pose"]["height_m"] == 6.0
    assert states(clocked.http) == {"drifting"}
    page = clocked.http.get("/ui/cameras/corner").text
    assert "<title>Clock: The corner" in page
    assert 'data-outcome="fixed"' in page
    assert 'data-outcome="accepted"' not in page
    assert re.search(r"<b>1</b> Clock", clocked.http.get("/").text)
    assert moved_count(clocked.http) == 0


def test_a_mended_clock_is_judged_by_who_comes_then(clocked):
    resolve(clocked, "fixed", note="NTP was off")
    (alert,) = clocked.alerts()
    assert (alert["outcome"], alert["resolved_by"]) == ("fixed", "Ada")
    assert states(clocked.http) == {"learning"}
    assert "since the clock was fixed" in clocked.pose()["reason"]
    assert "Ada reported it as fixed. NTP was off" in told_history(clocked.http)
    clocked.see(PRIOR)
    assert states(clocked.http) == {"ok"}


def test_learning_anew_is_kept_as_what_it_is(bench):
    knock(bench)
    bench.http.post("/cameras/corner/reference/reset", json={"by": "Ada"}).raise_for_status()
    (alert,) = bench.alerts()
    assert (alert["outcome"], alert["resolved_by"]) == ("relearned", "Ada")


def test_other_alerts_are_mended_or_false(bench):
    with bench.store.write() as session:
        open_alert(
            session, bench.settings, "corner", "no_data", "warning", {}, None,
            reasons=as_said("nobody"), source=AlertSource.RHYTHM,
        )  # fmt: skip
    url = f"/alerts/{bench.alerts()[0]['id']}/resolve"
    problem(bench.http.post(url, json={"outcome": "put_back"}), 422, "malformed")
    resolve(bench, "fixed")
    assert bench.alerts()[0]["outcome"] == "fixed"


def test_the_note_of_an_accepted_pose_is_kept(bench):
    knock(bench)
    body = {"by": "Ada", "note": "new mast"}
    bench.http.post("/cameras/corner/pose/accept", json=body).raise_for_status()
    assert "Ada kept the new aim. new mast" in told_history(bench.http)
    assert bench.alerts()[0]["note"] == "new mast"
