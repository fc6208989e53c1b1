"""A report by hand-derived numbers: what was, what was done after how long, what moves often."""

import pytest
from fastapi.testclient import TestClient

from service.app import create_app
from tests.service.conftest import problem
from tests.service.fleet_bench import Fleet
from tests.service.reports.rows import BEGIN, END, put, some_weeks


@pytest.fixture
def fleet(settings):
    made = Fleet(settings.model_copy(update={"timezone": "Europe/Copenhagen"}))
    yield made
    made.close()


@pytest.fixture
def copenhagen(fleet):
    with TestClient(create_app(fleet.settings)) as client:
        some_weeks(fleet)
        yield client


def weekly(http, **query):
    answer = http.get("/reports/weekly", params={"from": BEGIN, "to": END, **query})
    assert answer.is_success, answer.text
    return answer.json()


def ids(items):
    return [item["alert_id"] for item in items]


def test_alerts_of_the_days_by_what_they_are_and_what_was_done(copenhagen):
    body = weekly(copenhagen)
    assert (body["from"], body["to"], body["cameras"], body["more"]) == (BEGIN, END, 3, False)
    (knock,) = body["moved"]
    assert (knock["alert_id"], knock["name"], knock["words"]) == ("a", "Corner 1", "tilt +3.0°")
    assert knock["drift"]["tilt_deg"] == pytest.approx(3.0, abs=1e-4)
    assert (knock["since"], knock["opened_at"]) == ("2026-03-24T09:40:00Z", "2026-03-24T10:00:00Z")
    assert (knock["taken_up_after_s"], knock["ended_after_s"]) == (720.0, 10_800.0)
    assert (knock["done"], knock["note"]) == ("put back by Ada after 3 hours", "a ladder")
    assert ids(body["false_alarms"]) == ["b"]
    # One that was open as the week began, and a tracker's, which speaks for its cameras.
    assert ids(body["clocks"]) == ["c"]
    assert ids(body["others"]) == ["e"]
    assert body["others"][0]["name"] == "3 cameras of bytetrack"
    assert body["others"][0]["done"] == "ended by itself after 60 minutes"


def test_eight_weeks_by_the_cameras_clock_and_who_has_most_in_them(copenhagen):
    body = weekly(copenhagen)
    assert [week["alerts"] for week in body["weeks"]] == [0, 0, 0, 0, 0, 1, 1, 3]
    assert body["weeks"][-1] == {
        "begins_at": BEGIN,
        "alerts": 3,
        "moved": 1,
        "false_alarms": 1,
    }
    (most,) = body["often"]
    assert most == {
        "camera_id": "c1",
        "name": "Corner 1",
        "alerts": 2,
        "moved": 1,
        "false_alarms": 0,
    }


def test_cameras_that_need_a_person_as_it_is_made(copenhagen, fleet):
    fleet.add("quiet", state="no_data")
    fleet.add("odd", state="unsure")
    fleet.add("maybe", state="suspected", tilt_deg=1.5)
    fleet.add("new", state="unconnected", tracks=0)
    body = weekly(copenhagen)
    found = {name: [each["camera_id"] for each in body[name]] for name in
             ("silent", "unsure", "unconnected", "uncalibrated")}  # fmt: skip
    assert found == {
        "silent": ["quiet"],
        "unsure": ["odd", "maybe"],
        "unconnected": ["new"],
        "uncalibrated": [],
    }


def test_one_that_nobody_answers_is_in_each_report(copenhagen, fleet):
    put(fleet, "x", "drift", "c2", "1 08:00")
    (old,) = [each for each in weekly(copenhagen)["moved"] if each["alert_id"] == "x"]
    assert (old["outcome"], old["ended_after_s"]) == (None, None)
    assert old["done"].startswith("nobody took it up in ")


def test_the_page_says_the_same_of_whole_days(copenhagen):
    page = copenhagen.get("/ui/report?from=2026-03-23&to=2026-03-29").text
    assert "<h1>Report, 23 Mar 2026 to 29 Mar 2026</h1>" in page
    for words in ("tilt +3.0°", "put back by Ada after 3 hours: a ladder", "Tue 24 Mar, 10:40"):
        assert words in page
    # Midnights in Copenhagen, an hour and then two ahead of UTC.
    assert "from=2026-03-22T23%3A00%3A00%2B00%3A00&amp;to=2026-03-29T22%3A00%3A00%2B00%3A00" in page
    assert copenhagen.get("/ui/report").status_code == 200


def test_days_that_are_none_are_refused(copenhagen):
    wrong = copenhagen.get("/reports/weekly", params={"from": END, "to": BEGIN})
    assert "a time before `to`" in problem(wrong, 422, "malformed")["errors"][0]["reason"]
    far = copenhagen.get("/reports/weekly", params={"from": "2020-01-01T00:00:00Z", "to": END})
    problem(far, 422, "malformed")
    for days in ("from=2026-03-29&to=2026-03-01", "to=9999-12-31", "from=0001-01-01"):
        problem(copenhagen.get(f"/ui/report?{days}"), 422, "malformed")
