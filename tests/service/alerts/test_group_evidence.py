"""Groups of one poster's cameras, and members whose own estimate indicates a turn."""

import time
from datetime import UTC, datetime, timedelta

import pytest
from fastapi.testclient import TestClient

from service.access import tokens
from service.access.tokens import TokenSpec
from service.alerts.alerts import open_alert
from service.app import create_app
from service.reasons import as_said
from service.store import references
from service.store.engines.store import Store
from tests.conftest import CAMERA, track


class City:
    """Cameras with access on, fed by tokens that name their cameras."""

    def __init__(self, http, settings):
        self.http, self.settings, self.store = http, settings, Store(settings)
        self._texts = {}
        self._token("admin", scopes=("admin",))
        self.http.headers["Authorization"] = f"Bearer {self._texts['admin']}"

    def _token(self, name, **spec):
        with self.store.write() as session:
            made = tokens.make_token(session, TokenSpec(name=name, **spec), None)
            self._texts[name] = made.text

    def feed(self, token, cameras, source="bytetrack", **named):
        """Register cameras, and post a track of each by a token that names them all."""
        self._token(token, scopes=("ingest",), cameras=cameras, **named)
        headers = {"Authorization": f"Bearer {self._texts[token]}"}
        for camera_id in cameras:
            self.http.post("/cameras", json={**CAMERA, "id": camera_id}).raise_for_status()
            body = {"source": source, "tracks": [track("1", time.time() - 60)]}
            url = f"/cameras/{camera_id}/tracks"
            self.http.post(url, json=body, headers=headers).raise_for_status()

    def move(self, camera_id, tilt_deg=3.0):
        with self.store.write() as session:
            open_alert(
                session,
                self.settings,
                camera_id,
                "drift",
                "critical",
                {"tilt_deg": tilt_deg},
                datetime.now(UTC) - timedelta(minutes=5),
                reasons=as_said("far"),
            )

    def firing(self):
        found = self.http.get("/alerts", params={"state": "firing"}).json()["items"]
        return {alert["camera_id"]: alert for alert in found}


@pytest.fixture
def city(settings):
    on = settings.model_copy(update={"auth": "on"})
    with TestClient(create_app(on)) as http:
        made = City(http, on)
        yield made
        made.store.close()


@pytest.mark.parametrize("named", [{}, {"sources": ("bytetrack",)}])
def test_cameras_of_another_token_join_no_group(city, named):
    """They made a real turn of 8 deg one of three cameras of a faulty tracker."""
    city.feed("tracker", ("gate",))
    city.feed("liar", ("fake-0", "fake-1"), **named)
    city.move("fake-0")
    city.move("fake-1")
    city.move("gate", tilt_deg=8.0)
    firing = city.firing()
    assert set(firing) == {"fake-0", "fake-1", "gate"}
    assert {alert["group_id"] for alert in firing.values()} == {None}
    assert firing["gate"]["drift"] == {"tilt_deg": 8.0}


def test_each_token_has_a_group_of_its_own(city):
    city.feed("tracker", ("gate-0", "gate-1", "gate-2"))
    city.feed("liar", ("fake-0", "fake-1", "fake-2"))
    for camera_id in ("gate-0", "fake-0", "gate-1", "fake-1", "gate-2", "fake-2"):
        city.move(camera_id)
    found = city.http.get("/alerts", params={"kind": "many_moved"}).json()["items"]
    members = sorted(group["camera_ids"] for group in found)
    assert members == [["fake-0", "fake-1", "fake-2"], ["gate-0", "gate-1", "gate-2"]]


def test_cameras_of_another_token_do_not_dilute_a_group(city):
    city.feed("tracker", ("gate-0", "gate-1", "gate-2"))
    city.feed("liar", tuple(f"fake-{n}" for n in range(9)))
    for n in range(3):
        city.move(f"gate-{n}")
    assert city.firing()[None]["camera_ids"] == ["gate-0", "gate-1", "gate-2"]


@pytest.fixture
def together(fleet):
    """A turned camera and two with a wrong clock, of one source, in a group."""
    for camera_id in ("turned", "clock-0", "clock-1"):
        fleet.add(camera_id)
        with fleet.store.write() as session:
            references.newest(session, camera_id).source = "bytetrack"
    fleet.knock("clock-0", kind="clock", tilt_deg=0.0)
    fleet.knock("clock-1", kind="clock", tilt_deg=0.0)
    fleet.knock("turned", tilt_deg=8.0)
    return fleet


def group_of(http):
    (group,) = http.get("/alerts", params={"kind": "many_moved", "state": "firing"}).json()["items"]
    return group


def firing_of(http):
    items = http.get("/alerts", params={"state": "firing"}).json()["items"]
    return [(each["camera_id"], each["kind"], each["group_id"]) for each in items]


@pytest.mark.parametrize("outcome", ["false_alarm", "fixed"])
def test_answer_about_a_group_leaves_a_member_that_turned(http, together, outcome):
    """`false_alarm` ended the alert of a real turn of 8 deg."""
    group = group_of(http)
    assert group["camera_ids"] == ["clock-0", "clock-1", "turned"]
    url = f"/alerts/{group['id']}/resolve"
    body = http.post(url, json={"outcome": outcome, "by": "Ada"}).json()
    assert (body["state"], body["outcome"]) == ("resolved", outcome)
    assert firing_of(http) == [("turned", "drift", None)]
    pose = http.get("/cameras/turned/pose").json()
    assert (pose["state"], round(pose["drift"]["tilt_deg"], 1)) == ("drifting", 8.0)
    assert http.get("/cameras/clock-0/pose").json()["state"] != "drifting"


def test_member_that_a_group_left_is_notified_by_itself(http, together):
    hook = http.post("/webhooks", json={"url": "http://93.184.215.14/hook"}).json()["id"]
    http.post(f"/alerts/{group_of(http)['id']}/resolve", json={"outcome": "false_alarm"})
    log = http.get(f"/webhooks/{hook}/deliveries").json()["items"]
    sent = [http.get(f"/deliveries/{item['id']}").json()["payload"] for item in log]
    opened = [each["data"]["camera_id"] for each in sent if each["type"] == "alert.opened"]
    assert opened == ["turned"]


def test_members_that_a_group_left_make_no_second_group(http, fleet):
    for n in range(3):
        fleet.add(f"turned-{n}")
        with fleet.store.write() as session:
            references.newest(session, f"turned-{n}").source = "bytetrack"
        fleet.knock(f"turned-{n}", tilt_deg=8.0)
    http.post(f"/alerts/{group_of(http)['id']}/resolve", json={"outcome": "false_alarm"})
    for n in range(3):
        fleet.knock(f"turned-{n}", tilt_deg=8.0)  # the next estimates
    assert sorted(firing_of(http)) == [(f"turned-{n}", "drift", None) for n in range(3)]
