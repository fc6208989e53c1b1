"""The bridge between a real mosquitto and a real service."""

import shutil
import subprocess
import time

import pytest

from models.tracks.scenes import load_scene
from service.commands.replay import camera_body
from tests.conftest import CAMERA, SCENES, track
from tests.running import wait_for
from tests.surefoot.bridge.stand import (
    Client5,
    bridged,
    broker,
    frigate_event,
    needs_mosquitto,
    paths_of,
)
from tests.surefoot.bridge.test_adapters import NESTED

PASSWD = shutil.which("mosquitto_passwd")
pytestmark = [pytest.mark.slow, needs_mosquitto]
PATH = [[[0.3 + 0.02 * n, 0.5 + 0.02 * n], 1_700_000_000.0 + n] for n in range(8)]


@pytest.fixture
def port(tmp_path):
    with broker(tmp_path) as port:
        yield port


@pytest.fixture
def corner(service):
    assert service.http.post("/cameras", json=CAMERA).status_code == 201
    return service


def publish(client, people):
    for camera, name, path in people:
        client.publish("frigate/events", frigate_event("new", name, camera, path[:1]))
        client.publish("frigate/events", frigate_event("end", name, camera, path))


def stored(service, camera_id="corner"):
    items = service.http.get(f"/cameras/{camera_id}/sources").json()["items"]
    return {each["name"]: each["tracks"] for each in items}


def test_posts_and_frigates_paths_come_in(tmp_path, port, corner):
    service = corner
    client = Client5(port)
    with bridged(tmp_path, port, service.url, cameras="Front=corner") as bridge:
        body = {"source": "own", "tracks": [track("1"), track("2")]}
        client.publish("surefoot/corner/tracks", body)
        client.publish("surefoot/corner/tracks", body)
        for kind in ("new", "update", "end", "end"):
            client.publish("frigate/events", frigate_event(kind, "17.5-a", "Front", PATH), qos=0)
        wait_for(lambda: stored(service) == {"own": 2, "frigate": 1})
        # Rejected for good, each with its reason, and none of them stops what comes after.
        client.publish("frigate/events", NESTED)
        client.publish("frigate/events", b"no JSON")
        client.publish("surefoot/Not..An-Id/tracks", body)
        client.publish("surefoot/nobody/tracks", body)
        client.publish("surefoot/corner/tracks", b"{}")
        client.publish("frigate/events", frigate_event("end", "2", "nobody", PATH))
        client.publish("frigate/events", frigate_event("end", "3", "Front", PATH[:3]))
        client.publish("frigate/events", frigate_event("end", "4", "Front", PATH))
        wait_for(lambda: stored(service) == {"own": 2, "frigate": 2})
        log = wait_for(lambda: "too_short" in (text := bridge.log.read_text()) and text)
        assert log.count("messages_rejected") == 3
        assert log.count("camera_unknown") == 1
        assert "not_found" not in log
        assert log.count("tracks_refused") == 1
        assert service.http.get("/readyz").json()["bridge_silent_s"] < 30
        assert bridge.stop() == 0
    assert service.http.get("/readyz").json()["bridge_silent_s"] is None
    # All were acknowledged: none of them comes again.
    with bridged(tmp_path, port, service.url) as bridge:
        bridge.wait_connected(2)
        client.publish("surefoot/corner/tracks", {"source": "own", "tracks": [track("9")]})
        wait_for(lambda: stored(service)["own"] == 3)
        assert bridge.log.read_text().count("refused") == log.count("refused")
    client.close()


def test_states_and_alerts_go_out_and_home_assistant_finds_them(tmp_path, port, corner):
    service = corner
    client = Client5(port, "surefoot/#", "homeassistant/#")
    heard = client.heard
    with bridged(tmp_path, port, service.url) as bridge:
        wait_for(lambda: "surefoot/corner/alert" in heard)
        assert heard["surefoot/corner/state"]["state"] == "unconnected"
        assert heard["surefoot/corner/alert"] == {"firing": [], "alerts": []}
        wait_for(lambda: heard.get("surefoot/bridge/availability") == "online")
        config = heard["homeassistant/device/surefoot_corner/config"]
        assert config["avty_t"] == "surefoot/bridge/availability"
        assert config["cmps"]["alert"]["dev_cla"] == "problem"
        assert config["cmps"]["alert"]["stat_t"] == "surefoot/corner/alert"
        # A second source opens an alert of kind `tracker`.
        for source in ("one", "other"):
            body = {"source": source, "tracks": [track("1")]}
            answer = service.http.post("/cameras/corner/tracks", json=body)
            assert answer.status_code == 202
        wait_for(lambda: heard["surefoot/corner/alert"]["firing"] == ["tracker"])
        bridge.kill()
        wait_for(lambda: heard["surefoot/bridge/availability"] == "offline")
        (alert,) = service.http.get("/alerts", params={"state": "firing"}).json()["items"]
        url = f"/alerts/{alert['id']}/resolve"
        assert service.http.post(url, json={"outcome": "false_alarm"}).status_code == 200
    with bridged(tmp_path, port, service.url) as bridge:
        wait_for(lambda: heard["surefoot/bridge/availability"] == "online")
        wait_for(lambda: heard["surefoot/corner/alert"]["firing"] == [])
        service.kill()
        wait_for(lambda: heard["surefoot/bridge/availability"] == "offline")
        service.start()
        wait_for(lambda: heard["surefoot/bridge/availability"] == "online")
        assert bridge.stop() == 0
        wait_for(lambda: heard["surefoot/bridge/availability"] == "offline")
    client.close()


@pytest.mark.skipif(not SCENES.is_dir(), reason=f"no recorded scenes in {SCENES}")
def test_no_track_is_lost_and_none_stored_twice(tmp_path, port, service):
    """The bridge is killed twice in mid-stream, and the service is away for a while."""
    scenes = [load_scene(SCENES / name) for name in ("town_centre", "wildtrack_c1", "wildtrack_c3")]
    for scene in scenes:
        body = camera_body(scene.scene_id, scene.intrinsics, scene.true_pose)
        assert service.http.post("/cameras", json=body).status_code == 201
    people = [
        (scene.scene_id, f"{name}-{day}", path)
        for day in range(3)
        for scene in scenes
        for name, path in paths_of(scene, 1_700_000_000.0 + 86_400 * day)
    ]
    client = Client5(port)
    quarter = len(people) // 4
    with bridged(tmp_path, port, service.url) as bridge:
        publish(client, people[:quarter])
        bridge.kill()
        publish(client, people[quarter : 2 * quarter])
        bridge.start()
        bridge.wait_connected(2)
        service.kill()
        publish(client, people[2 * quarter : 3 * quarter])
        wait_for(lambda: "tracks_wait" in bridge.log.read_text())
        bridge.kill()  # with many that it has, and the service has not
        bridge.start()
        publish(client, people[3 * quarter :])
        bridge.wait_connected(3)
        service.start()
        wanted = {
            scene.scene_id: sum(camera == scene.scene_id for camera, *_ in people)
            for scene in scenes
        }

        def counts():
            return {each: stored(service, each).get("frigate", 0) for each in wanted}

        wait_for(lambda: counts() == wanted, timeout_s=60)
        time.sleep(1.0)  # what a bridge that stored some twice would still post
        assert counts() == wanted
        assert len(people) > 300
    client.close()


@pytest.mark.skipif(PASSWD is None, reason="mosquitto_passwd is not installed")
def test_by_tls_with_a_user_and_not_without(tmp_path, corner):
    key, certificate, passwords = (tmp_path / name for name in ("key", "crt", "passwords"))
    subprocess.run(
        ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-keyout", key,
         "-out", certificate, "-subj", "/CN=broker", "-addext", "subjectAltName=IP:127.0.0.1"],
        check=True, capture_output=True,
    )  # fmt: skip
    subprocess.run([PASSWD, "-b", "-c", passwords, "us", "right"], check=True, capture_output=True)
    lines = [f"certfile {certificate}", f"keyfile {key}", f"password_file {passwords}"]
    with broker(tmp_path, *lines, "allow_anonymous false") as port:
        given = {"url": f"mqtts://127.0.0.1:{port}", "user": "us", "ca_file": str(certificate)}
        with bridged(tmp_path, port, corner.url, **given, password="right"):
            pass
        wrong = {
            "mqtt_refused": {**given, "password": "wrong"},
            "mqtt_away": {**given, "password": "right", "url": f"mqtts://localhost:{port}"},
        }
        for number, (word, settings) in enumerate(wrong.items()):
            folder = tmp_path / str(number)
            folder.mkdir()
            with bridged(folder, port, corner.url, word, **settings) as bridge:
                log = bridge.log.read_text()
                assert "Not authorized" in log or "CERTIFICATE_VERIFY_FAILED" in log
