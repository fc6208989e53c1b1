"""`surefoot serve` with a broker runs the bridge, minds it and takes it along."""

import contextlib

import psutil
import pytest

from service.access.tokens import TokenSpec, make_token
from service.store.engines.store import Store
from tests.conftest import CAMERA, track
from tests.running import wait_for
from tests.surefoot.bridge.stand import Client5, broker, needs_mosquitto

pytestmark = [pytest.mark.slow, needs_mosquitto]


def bridge_of(service):
    children = psutil.Process(service.process.pid).children()
    return next((each for each in children if "bridge" in each.cmdline()), None)


def test_the_bridge_lives_with_serve_and_its_death_is_told(tmp_path, service):
    assert service.http.post("/cameras", json=CAMERA).status_code == 201
    with broker(tmp_path) as port:
        client = Client5(port, "surefoot/bridge/availability")
        with contextlib.closing(Store(service.settings)) as store, store.write() as session:
            ada = make_token(session, TokenSpec(name="ada", scopes=("read",)), None).text
        # Tokens are needed, and nobody has made one for the bridge.
        service.start_again(mqtt_url=f"mqtt://127.0.0.1:{port}", workers=0, auth="on")
        service.http.headers["Authorization"] = f"Bearer {ada}"

        def stored():
            items = service.http.get("/cameras/corner/sources").json()["items"]
            return sum(each["tracks"] for each in items)

        wait_for(lambda: client.heard.get("surefoot/bridge/availability") == "online")
        client.publish("surefoot/corner/tracks", {"source": "own", "tracks": [track("1")]})
        wait_for(lambda: stored() == 1)
        first = bridge_of(service)
        first.kill()
        wait_for(lambda: "bridge_ended" in service.log.read_text())
        assert service.answers()
        client.publish("surefoot/corner/tracks", {"source": "own", "tracks": [track("2")]})
        wait_for(lambda: stored() == 2)
        second = bridge_of(service)
        service.kill()
        wait_for(lambda: not second.is_running() or second.status() == psutil.STATUS_ZOMBIE)
        service.start()
        third = wait_for(lambda: bridge_of(service))
        assert service.stop() == 0
        assert not third.is_running()
        client.close()
