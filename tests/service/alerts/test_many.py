"""All alerts: chosen, paged, saved as CSV, and answered many at once."""

import csv
import io
import re
from datetime import UTC, datetime, timedelta

import pytest

from service.alerts.alerts import open_alert
from service.api.middleware.pages import templates
from service.enums import AlertKind
from service.reasons import as_said
from service.store.alerts import AlertRecord, answers_of
from service.wording import alerts as alert_words
from tests.service.conftest import problem

HTML = {"Accept": "text/html"}


@pytest.fixture
def knocked(http, fleet):
    """Twelve cameras that were knocked, two with a wrong clock, and a silent one."""
    for n in range(12):
        fleet.add(f"c{n:02}", tilt_deg=3.0)
        fleet.knock(f"c{n:02}")
    for n in range(2):
        fleet.add(f"clock{n}")
        fleet.knock(f"clock{n}", kind="clock")
    fleet.add("silent", state="no_data")
    return http


def firing(http, **query):
    return http.get("/alerts", params={"state": "firing", **query}).json()["items"]


def test_alerts_are_chosen_by_kind_severity_and_time_and_paged(knocked):
    """`?kind=` was ignored."""
    assert {a["camera_id"] for a in firing(knocked, kind="clock")} == {"clock0", "clock1"}
    assert len(firing(knocked, kind=["clock", "drift"])) == 14
    assert firing(knocked, severity="warning") == []
    later = (datetime.now(UTC) + timedelta(hours=1)).isoformat()
    assert firing(knocked, **{"from": later}) == []
    assert len(firing(knocked, to=later)) == 14
    seen, cursor = [], None
    for _ in range(3):
        query = {"limit": 5, **({"cursor": cursor} if cursor else {})}
        page = knocked.get("/alerts", params=query).json()
        seen += [alert["id"] for alert in page["items"]]
        cursor = page["next_cursor"]
    assert cursor is None
    assert len(set(seen)) == 14
    problem(knocked.get("/alerts", params={"cursor": "7"}), 422, "malformed")


def test_many_are_answered_at_once_each_for_itself(knocked):
    ids = [alert["id"] for alert in firing(knocked)]
    body = {"ids": [*ids, "nobody"], "action": "resolve", "outcome": "put_back", "by": "Ada"}
    told = knocked.post("/actions", json=body).json()
    items, undo = told["items"], told["undo"]
    assert [item["id"] for item in items] == [*ids, "nobody"]
    refused = [item["problem"]["status"] for item in items if item["problem"]]
    assert sorted(refused) == [404, 422, 422]  # two clocks, which nobody puts back
    assert sorted(undo["ids"]) == [f"c{n:02}" for n in range(12)]  # and not the clocks'
    left_s = (datetime.fromisoformat(undo["until"]) - datetime.now(UTC)).total_seconds()
    assert 800 < left_s < 900
    left = firing(knocked)
    assert {alert["kind"] for alert in left} == {"clock"}
    until = (datetime.now(UTC) + timedelta(hours=2)).isoformat()
    two = [alert["id"] for alert in left]
    for more in ({"action": "acknowledge", "by": "Ada"}, {"action": "silence", "until": until}):
        done = knocked.post("/actions", json={"ids": two, **more}).json()
        assert [item["problem"] for item in done["items"]] == [None, None]
        assert done["undo"] is None
    assert all(alert["silenced"] and alert["acknowledged"] for alert in firing(knocked))
    back = {"ids": two, "action": "acknowledge", "acknowledged": False}
    knocked.post("/actions", json=back).raise_for_status()
    assert not any(alert["acknowledged"] for alert in firing(knocked))
    body = {"ids": ["c00", "c01"], "action": "maintenance", "to": until}
    assert [i["problem"] for i in knocked.post("/actions", json=body).json()["items"]] == [None] * 2
    assert len(knocked.get("/cameras/c01/maintenance").json()["items"]) == 1
    undone = knocked.post("/actions", json={"ids": ["c05", "c06"], "action": "undo"}).json()[
        "items"
    ]
    assert [item["problem"] for item in undone] == [None, None]
    assert len(firing(knocked, kind="drift")) == 2
    for wrong in (
        {"action": "silence"},
        {"action": "resolve"},
        {"action": "maintenance"},
        {"action": "tag"},
    ):
        problem(knocked.post("/actions", json={"ids": two, **wrong}), 422, "malformed")


def test_a_file_of_them_runs_nothing_in_a_spreadsheet(knocked, fleet):
    with fleet.store.write() as session:
        record = open_alert(
            session, fleet.settings, "silent", "tracker", "warning", {}, None,
            reasons=as_said("=HYPERLINK(1)"),
        )  # fmt: skip
        assert record is not None
        session.get(AlertRecord, record.id).track_source = "@SUM(1+1)"
    answer = knocked.get("/alerts", params={"format": "csv", "state": "firing"})
    assert answer.headers["content-type"].startswith("text/csv")
    rows = list(csv.DictReader(io.StringIO(answer.text)))
    assert len(rows) == 15
    assert (rows[0]["reason"], rows[0]["track_source"]) == ("'=HYPERLINK(1)", "'@SUM(1+1)")
    assert {row["kind"] for row in rows} == {"drift", "clock", "tracker"}


def test_a_browser_gets_a_page_that_says_the_same(knocked):
    """`/alerts` and `/wall` gave it JSON."""
    asked = knocked.get("/alerts?kind=clock", headers=HTML, follow_redirects=False)
    assert (asked.status_code, asked.headers["location"]) == (303, "/ui/alerts?kind=clock")
    wall = knocked.get("/wall", headers=HTML)
    assert wall.url.path == "/ui/wall"
    assert "<title>(14) Wall" in wall.text
    page = knocked.get("/ui/alerts").text
    assert "<title>(14) Alerts" in page
    shown = re.findall(r'<li class="alert-row" id="alert-(\w+)"', page)
    assert shown == [alert["id"] for alert in firing(knocked)]
    assert page.count('data-outcome="put_back"') == 12  # one of each camera
    assert "tilt +3.0°" in page
    clocks = knocked.get("/ui/alerts?kind=clock").text
    assert clocks.count("alert-row") == 2
    assert "clock or frame rate looks wrong" in clocks
    ended = knocked.get("/ui/alerts?state=resolved").text
    assert "No alert is like that" in ended
    assert "format=csv&amp;kind=clock&amp;state=firing" in clocks


@pytest.mark.parametrize("kind", list(AlertKind))
def test_each_kind_has_a_badge_with_a_shape_and_answers_that_are_taken(kind):
    ui = templates.env.get_template("camera/macros.html").module
    badge = ui.badge(kind, alert_words.BADGES[kind], "warning")
    (shape,) = re.findall(r'href="#(i-\w+)"', badge)
    icons = templates.env.get_template("_icons.html").render()
    assert f'id="{shape}"' in icons
    assert tuple(each.outcome for each in alert_words.answers(kind)) == answers_of(kind)
