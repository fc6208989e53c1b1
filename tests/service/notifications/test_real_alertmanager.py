"""The same against Alertmanager itself, where there is one: Debian's `prometheus-alertmanager`."""

import os
import shutil
import subprocess
from datetime import UTC, datetime, timedelta

import httpx
import pytest

from tests.running import free_port, wait_for

PROGRAM = (
    os.environ.get("SUREFOOT_TEST_ALERTMANAGER")
    or shutil.which("alertmanager")
    or shutil.which("prometheus-alertmanager")
)
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        PROGRAM is None,
        reason="no alertmanager: apt-get install prometheus-alertmanager, "
        "or SUREFOOT_TEST_ALERTMANAGER",
    ),
]


@pytest.fixture
def alertmanager(tmp_path):
    """Its URL."""
    config = tmp_path / "alertmanager.yml"
    config.write_text("route: {receiver: nobody}\nreceivers: [{name: nobody}]\n")
    port = free_port()
    with (tmp_path / "alertmanager.log").open("w") as log:
        process = subprocess.Popen(
            [PROGRAM, f"--config.file={config}", f"--storage.path={tmp_path}/data",
             f"--web.listen-address=127.0.0.1:{port}", "--cluster.listen-address="],
            stdout=log,
            stderr=log,
        )  # fmt: skip
    url = f"http://127.0.0.1:{port}"

    def ready():
        assert process.poll() is None, (tmp_path / "alertmanager.log").read_text()
        try:
            return httpx.get(f"{url}/-/ready").status_code == 200
        except httpx.TransportError:
            return False

    try:
        wait_for(ready)
        yield url
    finally:
        process.terminate()
        process.wait(10)


def held(url):
    """What it says is active."""
    found = httpx.get(f"{url}/api/v2/alerts").json()
    return sorted(
        (alert["labels"]["alertname"], alert["labels"]["severity"])
        for alert in found
        if alert["status"]["state"] != "suppressed"
    )


def test_alertmanager_holds_what_fires_and_nothing_else(post_room, alertmanager):
    hook = post_room.hook(alertmanager, format="alertmanager")
    post_room.open("drift", "warning")
    post_room.open("clock", changed_at=datetime.now(UTC) + timedelta(hours=2))
    post_room.send(hook)
    assert held(alertmanager) == [
        ("SurefootCameraClock", "warning"), ("SurefootCameraDrift", "warning")
    ]  # fmt: skip
    post_room.open("drift", "critical")
    post_room.end("clock")
    post_room.send(hook)
    assert held(alertmanager) == [("SurefootCameraDrift", "critical")]
    post_room.http.post(f"/webhooks/{hook['id']}/test").raise_for_status()
    post_room.end("drift")
    post_room.send(hook)
    assert held(alertmanager) == []
    log = post_room.log(hook)
    assert [a["status_code"] for d in log for a in d["attempts"]] == [200] * 6
