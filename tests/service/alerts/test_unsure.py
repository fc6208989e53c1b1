"""A camera of which nobody can say whether it moved: `unsure` and `suspected`; and since when."""

from datetime import UTC, datetime

import pytest

from service.cameras.status import camera_statuses
from service.store import references
from service.store.references import FlowMapRecord
from tests.service.alerts.test_states import (
    at,
    fleet_row,
    headline,
    moved_count,
    resolve,
    states,
)
from tests.service.bench import PRIOR, moved
from tests.service.operations.test_metrics import scrape, value

MAYBE = moved(tilt_deg=0.9)  # likelier than not that it is beyond what a still camera shows

UNKNOWN = dict.fromkeys(("height_m", "tilt_deg", "roll_deg", "heading_deg"))


def add_flow_map(bench):
    with bench.store.write() as session:
        reference_id = references.newest(session, "corner").id
        session.add(
            FlowMapRecord(
                reference_id=reference_id, data=b"made up", chart=None, tracks=200, weight=200.0,
                to_s=bench.clock_s, learned_at=datetime.now(UTC),
            )
        )  # fmt: skip


def seconds(text):
    return datetime.fromisoformat(text).timestamp()


def firing(bench):
    return [alert["kind"] for alert in bench.alerts(state="firing")]


def test_people_on_none_of_the_paths_are_an_alert_once(bench):
    bench.see(PRIOR)
    bench.see(PRIOR, changed=True)
    (first,) = bench.alerts()
    assert (first["kind"], first["severity"], first["state"]) == ("unsure", "warning", "firing")
    assert first["reason_code"] == bench.pose()["reason_code"] == "paths_changed"
    for _ in range(3):
        bench.see(PRIOR, changed=True)
    (again,) = bench.alerts()
    assert again["id"] == first["id"]
    assert again["updated_at"] > first["updated_at"]
    assert [event["kind"] for event in bench.events("alert")] == ["unsure"]


def test_every_place_says_that_a_camera_is_unsure(bench):
    bench.see(PRIOR)
    bench.see(PRIOR, changed=True)
    assert states(bench.http) == {"unsure"}
    assert "people walk on none of the learned paths" in fleet_row(bench.http)
    assert "alert:" not in fleet_row(bench.http)  # the state says it
    assert headline(bench.http).startswith("Something changed: people walk on none of the paths")
    assert moved_count(bench.http) == 0
    page = bench.http.get("/ui/cameras/corner").text
    assert '<span class="badge unsure">' in page
    assert ">Something changed</h2>" in page
    for text in (page, bench.http.get("/").text):
        assert '<symbol id="i-unsure"' in text
    found = scrape(bench.http)
    assert value(found, "surefoot_cameras", state="unsure") == 1
    assert value(found, "surefoot_alerts_firing", kind="unsure", severity="warning") == 1
    assert value(found, "surefoot_alert_firing", camera_id="corner", kind="unsure") == 1


def test_it_ends_by_itself_where_people_walk_on_the_paths_again(bench):
    add_flow_map(bench)
    bench.see(PRIOR, paths=True)
    bench.see(PRIOR, changed=True)
    bench.see(PRIOR)  # by speeds alone, which say nothing of paths
    assert states(bench.http) == {"unsure"}
    assert firing(bench) == ["unsure"]
    bench.see(PRIOR, paths=True)
    assert states(bench.http) == {"ok"}
    (alert,) = bench.alerts()
    assert (alert["state"], alert["outcome"], alert["resolved_by"]) == ("resolved", "cleared", None)


@pytest.mark.parametrize(
    ("outcome", "state"),
    [("put_back", "learning"), ("false_alarm", "ok"), ("accepted", "learning")],
)
def test_a_person_ends_it(bench, outcome, state):
    bench.see(PRIOR)
    bench.see(PRIOR, changed=True)
    resolve(bench, outcome)
    (alert,) = bench.alerts()
    assert (alert["state"], alert["outcome"], alert["resolved_by"]) == ("resolved", outcome, "Ada")
    assert states(bench.http) == {state}


def test_after_an_answer_a_dozen_people_have_to_say_it_anew(bench):
    bench.see(PRIOR, changed=True)
    resolve(bench, "false_alarm")
    bench.see(PRIOR, people=7, changed=True)
    assert (firing(bench), states(bench.http)) == ([], {"ok"})
    bench.see(PRIOR, changed=True)
    assert (firing(bench), states(bench.http)) == (["unsure"], {"unsure"})


def test_it_gives_way_to_a_drift(bench):
    bench.see(PRIOR)
    bench.see(PRIOR, changed=True)
    bench.see(moved(tilt_deg=5.0), changed=True)
    assert firing(bench) == ["drift"]
    assert states(bench.http) == {"drifting"}
    (unsure,) = bench.alerts(state="resolved")
    assert (unsure["kind"], unsure["outcome"]) == ("unsure", "cleared")
    assert unsure["note"] == "it is told as drift now"
    assert headline(bench.http).startswith("The camera turned 5.0°")


def test_nobody_is_told_of_it_during_maintenance(bench):
    bench.see(PRIOR)
    bench.http.post("/cameras/corner/maintenance", json={"to": at(1)}).raise_for_status()
    bench.see(PRIOR, changed=True)
    assert bench.alerts() == []


def test_a_suspected_camera_has_no_alert_and_one_word_everywhere(bench):
    bench.see(PRIOR)
    assert bench.see(MAYBE).state == "suspected"
    assert bench.alerts() == []
    assert states(bench.http) == {"suspected"}
    body = bench.pose()
    assert body["reason_code"] == "suspected"
    assert 0.5 <= body["moved"] < 0.99
    share = f"{100 * body['moved']:.0f} %"
    assert share in body["reason"]
    assert "which is not sure enough for an alert" in body["reason"]
    assert f"It may have moved ({share})" in headline(bench.http)
    row = fleet_row(bench.http)
    assert row.count("Maybe moved") == 1  # the badge's word
    assert "may have moved" in row
    assert '<span class="badge suspected">' in bench.http.get("/ui/cameras/corner").text
    found = scrape(bench.http)
    assert value(found, "surefoot_cameras", state="suspected") == 1
    told = value(found, "surefoot_camera_moved_probability", camera_id="corner")
    assert told == pytest.approx(body["moved"])
    bench.see(PRIOR)
    assert states(bench.http) == {"ok"}


def test_a_suspicion_says_since_when_and_an_alarm_keeps_it(bench):
    bench.see(PRIOR)
    stood_s = bench.clock_s + 19 + 0.4 * 19
    assert bench.pose()["since"] == {"after": None, "before": None}
    bench.see(MAYBE)
    since = bench.pose()["since"]
    assert seconds(since["after"]) == pytest.approx(stood_s)
    assert seconds(since["before"]) > stood_s
    with bench.store.read() as session:
        status = camera_statuses(session, bench.settings)["corner"]
    assert status.since == datetime.fromisoformat(since["before"])  # as the fleet's page has it
    bench.see(moved(tilt_deg=5.0))
    (alert,) = bench.alerts()
    assert alert["since"] == bench.pose()["since"] == since
    assert alert["changed_at"] == since["before"]
    bench.see(PRIOR)
    assert bench.pose()["since"] == {"after": None, "before": None}


def test_since_names_the_last_person_before_a_move_and_the_first_after_it(bench):
    bench.clock_s -= 2 * 86_400
    bench.learn()
    bench.post(10)
    last_s = bench.clock_s + 9 + 0.4 * 19
    bench.clock_s += 86_400  # nobody comes for a day
    bench.see(moved(tilt_deg=5.0), people=10, change=10)
    (alert,) = bench.alerts()
    since = alert["since"]
    assert bench.pose()["since"] == since
    assert seconds(since["after"]) == pytest.approx(last_s)
    assert seconds(since["before"]) == pytest.approx(bench.clock_s)
    assert seconds(since["before"]) - seconds(since["after"]) > 86_000
    bench.see(moved(tilt_deg=5.0))
    assert bench.alerts()[0]["since"] == bench.pose()["since"] == since
    resolve(bench, "put_back")
    bench.see(moved(tilt_deg=-5.0))  # another move, which has nothing of the one before
    assert seconds(bench.pose()["since"]["after"]) > seconds(since["before"])


def test_the_pose_says_how_likely_what_has_moved(bench):
    bench.http.post("/cameras/corner/reference/reset").raise_for_status()
    body = bench.pose()
    assert (body["moved"], body["moved_parameters"]) == (None, UNKNOWN)
    assert body["since"] == {"after": None, "before": None}
    bench.see(PRIOR)
    body = bench.pose()
    assert (body["state"], body["moved"], body["moved_parameters"]) == ("learning", 0.2, UNKNOWN)
    bench.learn()
    bench.see(PRIOR, paths=True)
    body = bench.pose()
    assert body["moved"] < 0.1
    bench.see(moved(tilt_deg=5.0), paths=True)
    body = bench.pose()
    assert body["moved"] > 0.99
    found = body["moved_parameters"]
    assert set(found) == {"tilt_deg", "roll_deg", "heading_deg", "height_m"}
    assert found["tilt_deg"] > 0.99
    assert max(found["roll_deg"], found["heading_deg"], found["height_m"]) < 0.5


@pytest.mark.parametrize("turn", [{"tilt_deg": 4.0}, {"roll_deg": -4.0}, {"heading_deg": 6.0}])
def test_a_camera_that_turned_is_never_a_clock(bench, turn):
    bench.see(PRIOR, paths=True)
    for height_m in (0.0, 1.2, -1.2):
        bench.see(moved(height_m=height_m, **turn), paths=True)
        assert firing(bench) == ["drift"]


def test_the_prior_and_the_certainty_are_settings(bench):
    bench.see(PRIOR)
    bench.settings = bench.settings.model_copy(
        update={"drift_certainty": 0.5, "drift_floor_deg": 0.2}
    )
    assert bench.see(MAYBE).state == "drifting"
    assert firing(bench) == ["drift"]
