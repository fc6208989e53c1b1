"""Real processes over a real file: what survives `kill -9`, and what does not happen twice."""

import json
import os
import signal
import threading
import time

import httpx
import psutil
import pytest

from service.workers.processes import exits
from tests.conftest import CAMERA, track
from tests.running import pid_exists, wait_for
from tests.service.commands import forked
from tests.service.commands.forked import Forked

pytestmark = pytest.mark.slow


@pytest.fixture
def service(training_service):
    return training_service


def states(service):
    items = service.http.get("/cameras/corner/trainings").json()["items"]
    return [item["state"] for item in items]


def people(count, start_s=None):
    start_s = time.time() - 600 if start_s is None else start_s
    tracks = []
    for n in range(count):
        walk = track(str(n), start_s=start_s + n)
        for point in walk["points"]:
            point[2] += 3 * n % 200
        tracks.append(walk)
    return tracks


def test_tracks_in_a_worker_killed_in_training_one_pose_out_and_a_clean_stop(service):
    wait_for(service.ready)
    service.http.post("/cameras", json=CAMERA).raise_for_status()
    batch = {"source": "t", "tracks": people(30)}
    receipt = service.http.post("/cameras/corner/tracks", json=batch).json()
    assert receipt["accepted"] == 30
    wait_for(lambda: states(service) == ["running"])
    url = "/cameras/corner/trainings"
    wait_for(lambda: service.http.get(url).json()["items"][0]["progress"]["step"])
    killed = service.worker_pid()
    os.kill(killed, signal.SIGKILL)
    wait_for(lambda: states(service) == ["succeeded"], timeout_s=120)
    assert service.worker_pid() != killed
    body = wait_for(
        lambda: (
            "averaged" in (b := service.http.get("/cameras/corner/pose").json())["estimates"] and b
        )
    )
    assert body["tracks"] == 30
    assert {body["estimates"][name]["tracks"] for name in ("averaged", "joint")} == {30}
    assert body["reason"] == "30 of 200 people for the reference"
    time.sleep(3)  # some reconciles
    assert states(service) == ["succeeded"]  # it trained again, once
    training = service.http.get(url).json()["items"][0]
    assert training["progress"]["step"] == training["progress"]["steps"] > 0
    assert training["metrics"]["walks"] > 1000
    assert training["error"] is None
    assert service.http.get("/cameras/corner").json()["model_id"] is not None
    assert service.log.read_text().count("training_started") == 2
    assert service.log.read_text().count("training_ended") == 1
    weights = list(service.settings.weights_dir.iterdir())
    assert len(weights) == 1
    assert weights[0].suffix == ".safetensors"
    worker = service.worker_pid()
    assert service.stop() == 0
    assert not pid_exists(worker)


def test_the_http_process_holds_no_torch_and_little_memory(service_by_itself):
    service = service_by_itself
    wait_for(service.ready)
    service.http.post("/cameras", json=CAMERA).raise_for_status()
    for part in range(5):
        batch = {"source": f"s{part}", "tracks": people(400)}
        service.http.post("/cameras/corner/tracks", json=batch).raise_for_status()
        service.http.get("/cameras/corner/pose").raise_for_status()
    process = psutil.Process(service.process.pid)
    assert process.memory_info().rss < 200e6
    maps = [region.path for region in process.memory_maps()]
    assert not [path for path in maps if "torch" in path]
    (training,) = wait_for(psutil.Process(service.worker_pid()).children)
    wait_for(lambda: [region for region in training.memory_maps() if "torch" in region.path])
    wait_for(lambda: training.nice() == service.settings.training_nice)


def test_the_api_killed_after_202_has_the_tracks_and_ends_its_workers(service):
    wait_for(service.ready)
    service.http.post("/cameras", json=CAMERA).raise_for_status()
    worker = service.worker_pid()
    batch = {"source": "t", "tracks": people(25)}
    answer = service.http.post("/cameras/corner/tracks", json=batch)
    service.kill()
    assert answer.status_code == 202
    wait_for(lambda: not pid_exists(worker), timeout_s=15)
    service.start()
    assert service.http.get("/cameras/corner").json()["tracks"] == 25
    again = service.http.post("/cameras/corner/tracks", json=batch).json()
    assert (again["accepted"], again["duplicates"]) == (0, 25)
    wait_for(lambda: service.http.get("/cameras/corner/pose").json()["tracks"] == 25)
    wait_for(lambda: states(service) == ["running"])


@pytest.mark.nightly
def test_a_running_training_is_cancelled_and_a_queued_one_too(service):
    wait_for(service.ready)
    service.http.post("/cameras", json=CAMERA).raise_for_status()
    service.http.post("/cameras/corner/trainings", json={"recipe": "paper"}).raise_for_status()
    running = wait_for(
        lambda: [
            item
            for item in service.http.get("/cameras/corner/trainings").json()["items"]
            if item["state"] == "running"
        ]
    )[0]
    assert sorted(states(service)) == ["queued", "running"]  # one at once for a camera
    for item in service.http.get("/cameras/corner/trainings").json()["items"]:
        service.http.delete(f"/trainings/{item['id']}").raise_for_status()
    wait_for(lambda: states(service) == ["cancelled", "cancelled"], timeout_s=30)
    late = service.http.delete(f"/trainings/{running['id']}")
    assert late.status_code == 409
    time.sleep(3)
    assert service.http.get("/cameras/corner").json()["model_id"] is None


def test_events_arrive_as_they_happen_and_resume(service):
    wait_for(service.ready)
    seen, connected = [], threading.Event()

    def listen(headers):
        url = f"{service.url}/events"
        with httpx.stream("GET", url, headers=headers, timeout=60) as stream:
            event = {}
            for line in stream.iter_lines():
                if line == ": connected":
                    connected.set()
                name, _, value = line.partition(": ")
                if not line and "data" in event:
                    seen.append((int(event["id"]), event["event"], json.loads(event["data"])))
                    event = {}
                    if seen[-1][2].get("state") == "cancelled":
                        return
                elif name in ("id", "event", "data"):
                    event[name] = value

    listener = threading.Thread(target=listen, args=({},), daemon=True)
    listener.start()
    assert connected.wait(30)
    service.http.post("/cameras", json=CAMERA).raise_for_status()
    training = service.http.get("/cameras/corner/trainings").json()["items"][0]
    service.http.delete(f"/trainings/{training['id']}").raise_for_status()
    listener.join(30)
    live = list(seen)
    # That it was registered comes with the training that this begins.
    assert sorted(event[1] for event in live) == ["pose"] + ["training"] * (len(live) - 1)
    assert next(event[2] for event in live if event[1] == "training")["state"] == "queued"
    seen.clear()
    listen({"Last-Event-ID": str(live[0][0])})
    assert seen == live[1:]


@pytest.mark.nightly
def test_two_workers_of_one_name_do_not_run_beside_each_other(service, tmp_path):
    wait_for(service.ready)
    words = ["worker", "--name", "local-0"]
    second = forked.run(words, service.settings.as_environment(), tmp_path, timeout_s=60)
    assert second.returncode == exits.REFUSED
    assert "running already" in second.stderr


def test_a_lost_workers_training_is_taken_over(service):
    """A worker that never comes back: another one takes its jobs."""
    service.start_again(workers=0)
    environment = service.settings.as_environment() | {"SUREFOOT_WORKER_LOST_S": "3"}

    def worker(name):
        return Forked(["worker", "--name", name], environment, service.log, service.log)

    first = worker("one")
    service.http.post("/cameras", json=CAMERA).raise_for_status()
    wait_for(lambda: states(service) == ["running"])
    second = worker("two")
    try:
        wait_for(lambda: 'worker_started worker="two' in service.log.read_text())
        first.kill()
        begun = service.log.read_text().count("training_started")
        assert begun == 1
        wait_for(lambda: service.log.read_text().count("training_started") == 2, timeout_s=120)
        assert states(service) == ["running"]
        second.terminate()
        assert second.wait(20) == 0
    finally:
        for process in (first, second):
            process.kill()
            process.wait(10)
