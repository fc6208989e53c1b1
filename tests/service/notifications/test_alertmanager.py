"""An Alertmanager as the target: bodies of its v2 API, ends, severities, and telling again."""

import json
import re
from datetime import UTC, datetime, timedelta

import pytest

from service.alerts import alerts
from service.alerts.staleness import StaleWatch
from service.enums import MessageType
from service.notifications.messages import alert_name, postable_alerts
from service.notifications.outbox import alert_body
from service.reasons import as_said
from service.workers.upkeep.reconciliation import run_reconcile
from tests.service.conftest import problem
from tests.service.notifications.receiver import receiver

RFC3339 = re.compile(r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?(Z|[+-]\d\d:\d\d)$")
LABEL = re.compile(r"^[a-zA-Z_][a-zA-Z0-9_]*$")


@pytest.fixture
def inbox():
    with receiver() as found:
        found.url = found.url.removesuffix("/hook") + "/am/"
        found.answer(200)
        yield found


@pytest.fixture
def manager(post_room, inbox):
    return post_room.hook(inbox.url, format="alertmanager")


def checked(received):
    """The alerts of a request, after `postableAlerts` of Alertmanager's openapi.yaml."""
    assert received.path == "/am/api/v2/alerts"
    assert received.headers["content-type"] == "application/json"
    posted = received.json
    assert isinstance(posted, list)
    assert posted
    for alert in posted:
        assert set(alert) <= {"labels", "annotations", "startsAt", "endsAt", "generatorURL"}
        assert alert["labels"]["alertname"]
        for name, text in [*alert["labels"].items(), *alert["annotations"].items()]:
            assert LABEL.match(name), name
            assert isinstance(text, str)
        assert all(alert["labels"].values())
        times = [alert[name] for name in ("startsAt", "endsAt") if name in alert]
        assert all(RFC3339.match(time) for time in times)
        # Alertmanager refuses what ends before it starts.
        assert times == sorted(times, key=datetime.fromisoformat)
    return posted


def standing(inbox):
    """What Alertmanager would hold: the last word on each set of labels; True where it fires."""
    held = {}
    for received in inbox.received:
        for alert in checked(received):
            ends = alert.get("endsAt")
            over = ends is not None and datetime.fromisoformat(ends) <= datetime.now(UTC)
            held[json.dumps(alert["labels"], sort_keys=True)] = not over
    return [
        (labels["alertname"], labels["severity"])
        for labels in (json.loads(key) for key, fires in held.items() if fires)
    ]


def test_an_alert_and_its_end(post_room, inbox, manager):
    moved = datetime.now(UTC) - timedelta(minutes=50)
    with post_room.store.write() as session:
        alerts.open_alert(
            session, post_room.settings, "corner", "drift", "critical",
            {"tilt_deg": 5.25, "roll_deg": None}, moved,
            reasons=as_said("tilt +5.25 deg"),
        )  # fmt: skip
    post_room.send(manager)
    alert = checked(inbox.received[0])[0]
    assert alert["labels"] == {
        "alertname": "SurefootCameraDrift", "kind": "drift", "severity": "critical",
        "camera_id": "corner",
    }  # fmt: skip
    assert alert["annotations"]["description"] == "tilt +5.25 deg"
    assert alert["annotations"]["drift_tilt_deg"] == "5.25"
    assert "drift_roll_deg" not in alert["annotations"]
    assert datetime.fromisoformat(alert["startsAt"]) == moved
    assert "endsAt" not in alert
    assert "generatorURL" not in alert
    assert standing(inbox) == [("SurefootCameraDrift", "critical")]
    post_room.end()
    post_room.send(manager)
    assert standing(inbox) == []
    end = checked(inbox.received[-1])[0]
    assert end["labels"] == alert["labels"]
    assert end["startsAt"] == alert["startsAt"]
    assert end["annotations"]["outcome"] == "cleared"


def test_another_severity_ends_the_alert_of_the_first(post_room, inbox, manager):
    post_room.open(severity="warning")
    post_room.send(manager)
    assert standing(inbox) == [("SurefootCameraDrift", "warning")]
    post_room.open(severity="critical")
    post_room.send(manager)
    assert standing(inbox) == [("SurefootCameraDrift", "critical")]
    post_room.open(severity="warning")
    post_room.send(manager)
    assert standing(inbox) == [("SurefootCameraDrift", "warning")]
    post_room.end()
    post_room.send(manager)
    assert standing(inbox) == []


def test_a_change_that_the_camera_dates_after_its_alert_is_no_contradiction(post_room, inbox):
    """Cameras' clocks may be ahead; Alertmanager refuses alerts that end before they start."""
    manager = post_room.hook(inbox.url, format="alertmanager")
    post_room.open("clock", changed_at=datetime.now(UTC) + timedelta(hours=2))
    post_room.end("clock")
    post_room.send(manager)
    for received in inbox.received:
        checked(received)
    assert standing(inbox) == []


def test_all_that_fires_is_told_again_without_a_row_in_the_log(post_room, inbox, manager):
    post_room.open("drift")
    post_room.open("no_data")
    post_room.send(manager)  # both, and the first telling of all
    told = len(inbox.received)
    post_room.send(manager)
    assert len(inbox.received) == told  # a minute is not over
    assert post_room.awaited() == []
    post_room.change(manager, refreshed_at=datetime.now(UTC) - timedelta(seconds=61))
    before = len(post_room.jobs())
    run_reconcile(post_room.context, StaleWatch())
    assert len(post_room.jobs()) == before + 1
    post_room.send(manager)
    again = checked(inbox.received[-1])
    assert len(inbox.received) == told + 1
    names = {alert["labels"]["alertname"] for alert in again}
    assert names == {"SurefootCameraDrift", "SurefootCameraNoData"}
    assert not any("endsAt" in alert for alert in again)
    assert len(post_room.log(manager)) == 2
    post_room.end("drift")
    post_room.end("no_data")
    post_room.send(manager)
    told = len(inbox.received)
    post_room.change(manager, refreshed_at=None)
    assert post_room.awaited() == []
    post_room.send(manager)
    assert len(inbox.received) == told  # nothing fires, nothing is told


def test_an_alertmanager_that_is_down_is_told_when_it_is_back(post_room, inbox, manager):
    inbox.answer(503, 200)
    post_room.open()
    post_room.send(manager)
    assert post_room.show(manager)["last_error"].startswith("answered 503")
    post_room.send_now(manager)
    assert standing(inbox) == [("SurefootCameraDrift", "warning")]
    assert post_room.show(manager)["last_error"] is None


def test_a_refresh_that_fails_is_seen_and_tried_again(post_room, inbox, manager):
    post_room.open()
    post_room.send(manager)
    inbox.answer(500, 200)
    post_room.change(manager, refreshed_at=None)
    post_room.send(manager)
    assert post_room.show(manager)["failing_since"] is not None
    post_room.change(manager, refreshed_at=None, held_until=None)
    post_room.send(manager)
    assert post_room.show(manager)["failing_since"] is None


def test_an_old_message_does_not_fire_what_has_ended(post_room, inbox, manager):
    post_room.open()
    post_room.end()
    post_room.send(manager)
    opened = post_room.log(manager)[-1]
    post_room.http.post(f"/deliveries/{opened['id']}/replay").raise_for_status()
    post_room.send(manager)
    assert len(inbox.received) == 3
    assert standing(inbox) == []


def test_what_is_silenced_here_or_gone_with_its_camera_has_ended_there(post_room, inbox, manager):
    drift, no_data = post_room.open("drift"), post_room.open("no_data")
    post_room.send(manager)
    assert len(standing(inbox)) == 2
    with post_room.store.write() as session:
        record = alerts.show_alert(session, drift)
        record.silenced_until = datetime.now(UTC) + timedelta(hours=1)
        alerts._tell(session, record, MessageType.ALERT_SILENCED)
    post_room.change(manager, refreshed_at=None)
    post_room.send(manager)
    assert standing(inbox) == [("SurefootCameraNoData", "warning")]
    with post_room.store.write() as session:
        alerts.show_alert(session, drift).silenced_until = datetime.now(UTC)
    post_room.change(manager, refreshed_at=None)
    post_room.send(manager)
    assert len(standing(inbox)) == 2  # the silence is over, and it fires still
    etag = post_room.http.get("/cameras/corner").headers["etag"]
    post_room.http.delete("/cameras/corner", headers={"If-Match": etag}).raise_for_status()
    post_room.send(manager)
    assert standing(inbox) == []
    assert no_data != drift


def test_only_kinds_that_are_wanted_are_told_again(post_room, inbox):
    manager = post_room.hook(inbox.url, format="alertmanager", kinds=["no_data"])
    post_room.open("drift")
    assert post_room.awaited() == []
    post_room.open("no_data")
    post_room.send(manager)
    assert standing(inbox) == [("SurefootCameraNoData", "warning")]


def test_the_test_button_ends_by_itself(post_room, inbox, manager):
    post_room.http.post(f"/webhooks/{manager['id']}/test").raise_for_status()
    post_room.send(manager)
    (alert,) = checked(inbox.received[0])
    assert alert["labels"]["alertname"] == "SurefootTest"
    assert standing(inbox) == []


def test_an_alertmanager_has_no_secret_and_gets_no_signature(post_room, inbox, manager):
    assert manager["secret"] is None
    answer = post_room.http.post(f"/webhooks/{manager['id']}/secret")
    assert "this is alertmanager" in problem(answer, 409, "conflict")["detail"]
    post_room.open()
    post_room.send(manager)
    assert "webhook-signature" not in inbox.received[0].headers


def test_a_public_url_makes_links_and_names_come_of_kinds():
    body = dict.fromkeys(
        ("camera_id", "changed_at", "resolved_at", "acknowledged_by", "outcome"), None
    )
    body |= {"id": "a1", "kind": "no_data", "severity": "warning", "reason": "r", "drift": {}}
    body["opened_at"] = "2026-11-21T10:00:00Z"
    (alert,) = postable_alerts(body, "https://surefoot.example/", changed=False)
    assert alert["generatorURL"] == "https://surefoot.example/alerts/a1"
    assert "camera_id" not in alert["labels"]  # of no one camera
    assert alert["labels"]["alertname"] == alert_name("no_data") == "SurefootCameraNoData"


def test_a_group_is_told_as_one_alert_of_its_tracker(post_room):
    alert_id = post_room.open("clock")
    with post_room.store.read() as session:
        body = alert_body(alerts.show_alert(session, alert_id))
    body |= {
        "kind": "many_moved",
        "camera_id": None,
        "camera_ids": ["a", "b", "c"],
        "track_source": "bytetrack",
        "poster_id": "3f9c01d2ab44",
    }
    (alert,) = postable_alerts(body, None, changed=False)
    assert alert["labels"]["track_source"] == "bytetrack"
    assert alert["labels"]["poster_id"] == "3f9c01d2ab44"
    assert "camera_id" not in alert["labels"]
    assert alert["annotations"]["summary"] == "many moved: 3 cameras of bytetrack"
