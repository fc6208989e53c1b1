"""A bridge that does not work is shown on `/readyz`, `/metrics` and pages, and raises an alert."""

from datetime import UTC, datetime, timedelta

import pytest
from prometheus_client.parser import text_string_to_metric_families as families

from service.access.tokens import TokenSpec, make_token
from service.alerts import bridges as watching
from service.alerts.staleness import StaleWatch
from service.app import create_app
from service.commands.local_bridge import LocalBridge
from service.operations.bridges import note_trouble
from service.store import bridges
from service.store.bridges import BridgeRecord
from tests.conftest import CAMERA
from tests.service.conftest import problem

STARTED = "2026-11-20T08:00:00Z"
BEAT = {
    "started_at": STARTED,
    "connected": True,
    "waiting": 3,
    "counts": {"messages": 40, "messages_rejected": 2, "tracks_posted": 31},
    "unknown_cameras": {"nobody": 5},
    "cameras": ["corner", "removed"],
    "newest_rejections": [
        {"at": STARTED, "event": "messages_rejected", "topic": "cams/a/scene",
         "code": "malformed", "detail": "no JSON", "extract": "<b>secret</b>"}
    ],
}  # fmt: skip


def beat(http, **changes):
    answer = http.put("/bridges/nvr-east", json=BEAT | changes)
    assert answer.status_code == 204, answer.text


def age(store, **changes):
    with store.write() as session:
        record = session.get(BridgeRecord, "nvr-east")
        for name, value in changes.items():
            setattr(record, name, value)


def watched(store, settings, watch=None):
    with store.write() as session:
        (watch or StaleWatch()).watch(session, settings)


def firing(http):
    return http.get("/alerts", params={"state": "firing"}).json()["items"]


def test_heartbeat_is_shown_with_its_age_and_counts(corner, store):
    assert corner.get("/readyz").json()["bridge_silent_s"] is None
    beat(corner)
    beat(corner)
    body = corner.get("/readyz").json()
    assert 0 <= body["bridge_silent_s"] < 30
    assert not any(each.startswith("bridge") for each in body["problems"])
    found = {
        (sample.name, sample.labels.get("outcome", "")): sample.value
        for family in families(corner.get("/metrics").text)
        for sample in family.samples
        if sample.labels.get("bridge") == "nvr-east"
    }
    assert found["surefoot_bridge_connected", ""] == 1
    assert found["surefoot_bridge_tracks_waiting", ""] == 3
    assert found["surefoot_bridge_restarts_total", ""] == 0
    assert found["surefoot_bridge_items_total", "messages_rejected"] == 2
    assert found["surefoot_bridge_items_total", "rows_skipped"] == 0
    heard = found["surefoot_bridge_last_heartbeat_timestamp_seconds", ""]
    assert abs(heard - datetime.now(UTC).timestamp()) < 60
    page = corner.get("/ui/health").text
    for words in ("nvr-east", "Connected", "nobody (5)", "cams/a/scene: malformed, no JSON"):
        assert words in page
    assert "secret" not in page


def test_silent_bridge_is_named_and_its_cameras_get_one_alert(corner, store, settings):
    beat(corner)
    ago = datetime.now(UTC) - timedelta(seconds=watching.LOST_S + 600)
    age(store, heartbeat_at=ago)
    body = corner.get("/readyz").json()
    assert body["bridge_silent_s"] == pytest.approx(660, abs=30)
    words = "the MQTT bridge nvr-east has not reported for 11 min: tracks that it carries do not"
    assert [each[: len(words) + 8] for each in body["problems"] if "bridge" in each] == [
        f"bridge: {words}"
    ]
    assert (
        "The MQTT bridge nvr-east has not reported for 11 min"
        in corner.get("/ui/health/banner").text
    )
    # The service may have been off for as long: it watches for a while first.
    watched(store, settings)
    assert firing(corner) == []
    soon, watch = settings.model_copy(update={"stale_after_s": 0.0}), StaleWatch()
    watched(store, soon, watch)
    watched(store, soon, watch)
    (alert,) = firing(corner)
    assert (alert["kind"], alert["camera_id"], alert["severity"]) == ("stale", None, "critical")
    assert (alert["camera_ids"], alert["track_source"]) == (["corner"], "nvr-east")
    assert alert["reason_code"] == "bridge_silent"
    assert alert["reason_values"]["silent_s"] == pytest.approx(660, abs=30)
    for path in ("/", "/ui/alerts", "/ui/cameras/corner", "/wall"):
        assert corner.get(path, headers={"Accept": "text/html"}).status_code == 200
    beat(corner)
    watched(store, soon, watch)
    assert firing(corner) == []
    (ended,) = corner.get("/alerts").json()["items"]
    assert (ended["outcome"], ended["note"]) == ("cleared", "the bridge works again")


def test_bridge_that_starts_again_and_again_raises_an_alert(corner, store, settings):
    for minute in range(watching.MOST_STARTS):
        beat(corner, started_at=f"2026-11-20T08:0{minute}:00Z")
    watched(store, settings)
    assert firing(corner) == []
    # It has carried nothing yet, and feeds what the last one fed.
    beat(corner, started_at="2026-11-20T08:09:00Z", cameras=[])
    watched(store, settings)
    (alert,) = firing(corner)
    assert alert["reason_code"] == "bridge_restarts"
    assert alert["reason_values"] == {"bridge": "nvr-east", "starts": 4, "within_s": 600.0}
    # A person's answer holds for a while.
    answer = {"outcome": "false_alarm"}
    corner.post(f"/alerts/{alert['id']}/resolve", json=answer).raise_for_status()
    watched(store, settings)
    assert firing(corner) == []


def test_bridge_that_serve_cannot_keep_running_is_named(corner, store):
    with store.write() as session:
        note_trouble(session, "nvr-east", "it ended 3 times in a row, the last time: status 1")
    words = "the MQTT bridge nvr-east does not keep running: it ended 3 times in a row"
    assert any(words in each for each in corner.get("/readyz").json()["problems"])
    assert words[1:] in corner.get("/ui/health/banner").text
    with store.write() as session:
        note_trouble(session, "nvr-east", None)
    assert words[1:] not in corner.get("/ui/health/banner").text


def test_serve_names_its_bridge_from_the_third_end_on(corner, settings):
    bridge = LocalBridge(settings, "127.0.0.1", 1, None)
    words = "the MQTT bridge surefoot-bridge does not keep running: it ended 3 times in a row, the"
    for deaths in (1, 2, 3):
        assert not any(words in each for each in corner.get("/readyz").json()["problems"])
        bridge._tell(-11, deaths, 1.0)
    (problem,) = (each for each in corner.get("/readyz").json()["problems"] if words in each)
    assert problem.endswith("the last time: ended by signal 11")
    with bridge:  # no broker is configured any more
        assert not any(words in each for each in corner.get("/readyz").json()["problems"])


def test_bridge_without_its_broker_is_named_on_pages(corner, store):
    beat(corner, connected=False)
    words = "The MQTT bridge nvr-east is not connected to its broker"
    assert words in corner.get("/ui/health/banner").text


def test_bridge_that_was_stopped_is_no_problem_and_is_forgotten_after_days(corner, store):
    beat(corner, stopped=True)
    age(store, heartbeat_at=datetime.now(UTC) - timedelta(days=8))
    body = corner.get("/readyz").json()
    assert body["bridge_silent_s"] is None
    assert not any("bridge" in each for each in body["problems"])
    corner.put("/bridges/other", json=BEAT).raise_for_status()
    with store.read() as session:
        assert [record.name for record in bridges.every(session)] == ["other"]


@pytest.mark.parametrize(
    "body",
    [
        {},
        BEAT | {"started_at": "yesterday"},
        BEAT | {"cameras": ["corner"] * 1001},
        BEAT | {"unknown_cameras": {f"c{n}": 1 for n in range(101)}},
        BEAT | {"counts": {"messages": -1}},
        BEAT | {"counts": {"a\0": 1}},
    ],
)
def test_heartbeat_that_is_none_is_rejected(corner, body):
    problem(corner.put("/bridges/nvr-east", json=body), 422, "malformed")


def test_bridges_are_at_most_a_hundred(http, store):
    for n in range(100):
        http.put(f"/bridges/b{n}", json=BEAT).raise_for_status()
    problem(http.put("/bridges/one-more", json=BEAT), 409, "conflict")


def test_heartbeat_needs_ingest_and_names_only_cameras_of_its_token(settings, store):
    from fastapi.testclient import TestClient

    with store.write() as session:
        texts = {
            name: make_token(session, TokenSpec(name=name, scopes=scopes, cameras=only), None).text
            for name, scopes, only in (
                ("bridge", ("ingest",), ("corner",)),
                ("other", ("ingest",), None),
                ("reader", ("read",), None),
                ("admin", ("admin",), None),
            )
        }
    with TestClient(create_app(settings.model_copy(update={"auth": "on"}))) as http:

        def put(name, **changes):
            headers = {"Authorization": f"Bearer {texts[name]}"}
            return http.put("/bridges/nvr-east", json=BEAT | changes, headers=headers)

        admin = {"Authorization": f"Bearer {texts['admin']}"}
        for camera_id in ("corner", "gate"):
            body = {**CAMERA, "id": camera_id}
            http.post("/cameras", json=body, headers=admin).raise_for_status()
        problem(http.put("/bridges/nvr-east", json=BEAT), 401, "unauthorized")
        problem(put("reader"), 403, "forbidden")
        assert put("bridge", cameras=["corner", "gate"]).status_code == 204
        with store.read() as session:
            record = session.get(BridgeRecord, "nvr-east")
            assert list(record.report["cameras"]) == ["corner"]
        problem(put("other"), 403, "forbidden")
        age(store, heartbeat_at=datetime.now(UTC) - timedelta(minutes=5))
        assert put("other").status_code == 204
