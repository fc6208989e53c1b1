"""Real workers that hang, die at once, grow too large, or whose clock is set back."""

import fcntl
import os
import signal
import time

import httpx
import psutil
import pytest

from service.workers.processes import exits
from service.workers.processes.workers import worker_name
from tests.conftest import CAMERA, path_to_changed, track
from tests.faults.clock import Clock
from tests.running import RunningService, free_port, pid_exists, wait_for

pytestmark = pytest.mark.slow


def people(count, first=0):
    start_s = time.time() - 7200  # a clock that is set back an hour is not behind them
    return [track(str(n), start_s=start_s + n) for n in range(first, first + count)]


def log_of(service):
    return service.log.read_text()


@pytest.fixture
def start(settings, monkeypatch):
    """Start a service with some settings changed."""
    running = []

    def start_one(environment=None, *, forked=True, **changes):
        changed = settings.model_copy(update={"port": free_port(), "trainings": "off", **changes})
        service = RunningService(changed, forked=forked)
        running.append(service)
        with monkeypatch.context() as patch:
            for name, value in (environment or {}).items():
                patch.setenv(name, value)
            service.start()
        return service

    yield start_one
    for service in running:
        service.stop()


def test_a_worker_that_is_stopped_cold_is_ended_and_replaced(start):
    service = start(worker_lost_s=4)
    wait_for(service.ready)
    stopped = service.worker_pid()
    os.kill(stopped, signal.SIGSTOP)  # as one that hangs in native code: no thread of it runs
    wait_for(lambda: "worker_hangs" in log_of(service), timeout_s=30)
    wait_for(lambda: not pid_exists(stopped))
    name = worker_name(service.settings, "local-0")
    again = f'surefoot_worker_restarts_total{{worker="{name}"}} 1.0'
    wait_for(lambda: again in service.http.get("/metrics").text)
    assert service.worker_pid() != stopped
    wait_for(service.ready)


HANGS = """
import threading
import service.estimate_queue as queue

queue.start_run = lambda *_: threading.Event().wait()
"""


def test_a_look_that_never_ends_ends_its_worker_and_leaves_others_their_turn(start, tmp_path):
    path = path_to_changed(tmp_path, HANGS)  # no look ever comes to its end
    service = start({"PYTHONPATH": path}, estimate_limit_s=1.01, stale_failures=2)
    wait_for(service.ready)
    service.http.post("/cameras", json=CAMERA).raise_for_status()
    hung = service.worker_pid()
    service.http.post("/cameras/corner/tracks", json={"tracks": people(5)}).raise_for_status()
    wait_for(lambda: "job_hangs" in log_of(service))
    wait_for(lambda: not pid_exists(hung))
    wait_for(lambda: exits.words_of(exits.HANGS) in log_of(service))


@pytest.mark.nightly
def test_a_worker_refused_for_its_name_ends_the_service_with_one_line(start, settings):
    name = worker_name(settings, "local-0")
    lock = (settings.data_dir / f"worker-{name}.lock").open("w")
    fcntl.flock(lock, fcntl.LOCK_EX)
    service = start()
    assert service.process.wait(60) == exits.REFUSED
    assert log_of(service).count("worker refused:") == 1
    assert log_of(service).count("ERROR worker_refused") == 1
    assert "Traceback" not in log_of(service)


def test_a_worker_beyond_its_ceiling_ends_its_jobs_and_is_started_anew(start):
    service = start()
    wait_for(service.ready)
    rss_mb = psutil.Process(service.worker_pid()).memory_info().rss / 2**20
    assert rss_mb < 300
    service.http.post("/cameras", json=CAMERA).raise_for_status()
    service.start_again(worker_max_mb=50)
    service.http.post("/cameras/corner/tracks", json={"tracks": people(30)}).raise_for_status()
    wait_for(lambda: "worker_full" in log_of(service))
    wait_for(lambda: exits.words_of(exits.FULL) in log_of(service))
    wait_for(lambda: log_of(service).count("worker_started") >= 3)
    wait_for(lambda: service.http.get("/cameras/corner/pose").json()["tracks"] == 30)


@pytest.mark.nightly
def test_tracks_posted_while_their_camera_is_looked_at_are_looked_at_too(start):
    service = start()
    wait_for(service.ready)
    service.http.post("/cameras", json=CAMERA).raise_for_status()
    for part in range(40):
        body = {"tracks": people(3, 3 * part)}
        service.http.post("/cameras/corner/tracks", json=body).raise_for_status()
        time.sleep(0.05)
    pose = wait_for(
        lambda: (p := service.http.get("/cameras/corner/pose").json())["tracks"] == 120 and p
    )
    assert pose["reason"].startswith("120 of 200")
    wait_for(lambda: service.http.get("/readyz").json()["queue_lag_s"] == 0)
    assert log_of(service).count("estimate_stored") < 40


@pytest.mark.nightly
@pytest.mark.parametrize("jump_s", [-3600, 3600])
def test_a_clock_that_is_set_stops_nothing_and_doubles_nothing(start, tmp_path, jump_s):
    clock = Clock(tmp_path)
    if clock.environment is None:
        pytest.skip("no C compiler (cc) to make a clock with")
    service = start(clock.environment, forked=False, worker_lost_s=6)
    wait_for(service.ready)
    service.http.post("/cameras", json=CAMERA).raise_for_status()
    service.http.post("/cameras/corner/tracks", json={"tracks": people(10)}).raise_for_status()
    wait_for(lambda: service.http.get("/cameras/corner/pose").json()["tracks"] == 10)
    worker = service.worker_pid()
    clock.set(jump_s)
    time.sleep(8)
    service.http.post("/cameras/corner/tracks", json={"tracks": people(10, 10)}).raise_for_status()
    wait_for(lambda: service.http.get("/cameras/corner/pose").json()["tracks"] == 20)
    # The reconcile, which is a round, finds that the camera has no job for what is due.
    silence = service.http.get("/readyz").json()["worker_silent_s"]
    assert silence < 6
    wait_for(service.ready)
    assert service.worker_pid() == worker
    assert "workers_lost" not in log_of(service)
    assert httpx.get(f"{service.url}/alerts").json()["items"] == []
