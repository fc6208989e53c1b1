"""Flooded cameras and a quiet one: each has its turn, and no training stands in the way."""

import threading
import time

import httpx
import psutil
import pytest

from tests.conftest import CAMERA, track
from tests.running import wait_for

pytestmark = pytest.mark.slow

FLOODED = [f"flooded-{n}" for n in range(4)]


@pytest.fixture
def service(training_service):
    return training_service


def post(http, camera_id, first, count):
    start_s = time.time() - 6000
    tracks = [track(str(n), start_s=start_s + n) for n in range(first, first + count)]
    http.post(f"/cameras/{camera_id}/tracks", json={"tracks": tracks}).raise_for_status()


def looked_at(service, after=0):
    """Whose looks have come to their end, in their order, from a place of the log on."""
    lines = service.log.read_text()[after:].splitlines()
    return [
        line.split('camera_id="')[1].split('"')[0] for line in lines if "estimate_stored" in line
    ]


def test_a_quiet_camera_is_looked_at_after_one_turn_of_the_flooded_ones(service):
    wait_for(service.ready)
    for camera_id in (*FLOODED, "quiet"):
        service.http.post("/cameras", json={**CAMERA, "id": camera_id}).raise_for_status()
    stop = threading.Event()

    def flood():
        with httpx.Client(base_url=service.url, timeout=60) as http:
            for first in range(0, 100_000, 3):
                for camera_id in FLOODED:
                    if stop.is_set():
                        return
                    post(http, camera_id, first, 3)

    thread = threading.Thread(target=flood, daemon=True)
    thread.start()
    try:
        wait_for(lambda: len(looked_at(service)) > 2 * len(FLOODED))
        place = len(service.log.read_text())
        post(service.http, "quiet", 0, 10)
        wait_for(lambda: "quiet" in looked_at(service, place))
        seen = looked_at(service, place)
    finally:
        stop.set()
        thread.join(60)
    # Those that waited or ran already, and what ran beside them.
    assert seen.index("quiet") <= len(FLOODED) + 4
    wait_for(lambda: service.http.get("/readyz").json()["queue_lag_s"] == 0)


@pytest.mark.nightly
def test_a_training_yields_and_ends_with_its_worker(service):
    service.start_again(training_nice=7)
    service.http.post("/cameras", json=CAMERA).raise_for_status()
    worker = psutil.Process(service.worker_pid())
    (training,) = wait_for(worker.children)
    wait_for(lambda: training.nice() == 7)
    assert worker.nice() < 7
    worker.kill()
    wait_for(lambda: not training.is_running(), timeout_s=20)


@pytest.mark.nightly
def test_a_training_that_is_killed_is_tried_again_and_then_fails(service):
    wait_for(service.ready)
    service.http.post("/cameras", json=CAMERA).raise_for_status()
    worker = psutil.Process(service.worker_pid())
    for _ in range(3):
        (training,) = wait_for(worker.children)
        training.kill()
        wait_for(lambda pid=training.pid: not psutil.pid_exists(pid))
    failed = wait_for(
        lambda: (
            (t := service.http.get("/cameras/corner/trainings").json()["items"][0])["state"]
            == "failed"
            and t
        )
    )
    assert failed["error"] == "its process ended by signal 9"
    assert service.worker_pid() == worker.pid
