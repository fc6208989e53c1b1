"""Real processes under the memory that the units and the containers are shipped with.

`RLIMIT_DATA` stands for the limit of a cgroup, which a test may not set: it counts what a process
has asked for, which is more than what it uses.
"""

import re
import resource
import signal
import subprocess
import sys
import threading
from pathlib import Path

import httpx
import psutil
import pytest
import yaml

from service.commands.worker import _HARD_CEILING
from service.settings import Settings
from tests.benchmarks.bodies import BODIES
from tests.conftest import CAMERA, ROOT, track
from tests.running import served, wait_for

DEPLOY = ROOT / "deploy"
UNITS = {"api": DEPLOY / "surefoot.service", "worker": DEPLOY / "surefoot-worker@.service"}
COMPOSE = (DEPLOY / "compose.yaml", DEPLOY / "postgresql" / "compose.yaml")
_UNITS_OF = {"M": 2**20, "m": 2**20, "G": 2**30, "g": 2**30}
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="RLIMIT_DATA and /proc are Linux's")


def bytes_of(text):
    return int(text[:-1]) * _UNITS_OF[text[-1]]


def line_of(name, word):
    return re.search(rf"^{word}=(.+)$", UNITS[name].read_text(), re.MULTILINE)[1]


def of_unit(name):
    return bytes_of(line_of(name, "MemoryMax"))


def of_containers(name):
    """The limits of the API's or the workers' containers, by what they run."""
    run = {"api": "serve", "worker": "worker"}[name]
    made = [yaml.safe_load(path.read_text())["services"].values() for path in COMPOSE]
    services = [each for of_file in made for each in of_file]
    return [bytes_of(each["mem_limit"]) for each in services if run in each.get("command", [])]


def test_the_api_and_workers_have_limits_of_their_own():
    for name in UNITS:
        limits = of_containers(name)
        assert len(limits) == len(COMPOSE)
        assert min(limits) >= of_unit(name)
    # A worker ends a job by itself before the kernel ends it.
    assert _HARD_CEILING * Settings().worker_max_mb * 2**20 < of_unit("worker")
    commands = {name: line_of(name, "ExecStart").partition(" ")[2] for name in UNITS}
    assert commands == {"api": "serve --workers 0", "worker": "worker --name %i"}


def test_the_units_are_hardened_alike():
    parts = [unit.read_text().partition("StateDirectory=")[2] for unit in UNITS.values()]
    api, worker = (part.partition("[Install]")[0].strip() for part in parts)
    assert api == worker


@pytest.mark.nightly
def test_the_worst_bodies_at_once_leave_the_api_within_its_limit(migrated, tmp_path):
    names = ("csv x\\r", "source", "tracks of 1", "ndjson 11", "last row short", "NaN", "csv ids")
    names += ("honest",)
    said = {}
    with served(tmp_path, migrated) as api:
        assert api.http.post("/cameras", json=CAMERA).status_code == 201
        limit = of_unit("api")
        resource.prlimit(api.process.pid, resource.RLIMIT_DATA, (limit, limit))

        def post(name):
            kind, made = BODIES[name]
            said[name] = httpx.post(
                f"{api.url}/cameras/corner/tracks?frame_rate_hz=25&started_at=2026-11-01T00:00:00Z",
                content=made(), headers={"Content-Type": kind}, timeout=120,
            ).status_code  # fmt: skip

        posting = [threading.Thread(target=post, args=(name,)) for name in names]
        for each in posting:
            each.start()
        for each in posting:
            each.join()
        # 503: the others were not read in time; nothing of it was stored.
        assert set(said) == set(names)
        assert set(said.values()) <= {202, 413, 422, 503}, said
        status = Path(f"/proc/{api.process.pid}/status").read_text()
        peak_kb = int(status.partition("VmHWM:")[2].split()[0])
        assert peak_kb * 1024 < 0.6 * limit
        assert api.http.get("/healthz").status_code == 200


@pytest.mark.slow
def test_a_worker_that_the_kernel_ends_takes_the_api_with_it_no_more(migrated, tmp_path):
    def worker(name):
        command = [sys.executable, "-m", "service.cli", "worker", "--name", "1"]
        with (tmp_path / name).open("w") as log:
            made = subprocess.Popen(command, env=api.settings.as_environment(), stderr=log)
        wait_for(lambda: "worker_started" in (tmp_path / name).read_text())
        return made

    with served(tmp_path, migrated) as api:
        api.http.post("/cameras", json=CAMERA)
        first = worker("first.log")
        wait_for(lambda: api.http.get("/readyz").status_code == 200)
        assert psutil.Process(api.process.pid).children() == []
        first.send_signal(signal.SIGKILL)
        first.wait(10)
        posted = api.http.post("/cameras/corner/tracks", json={"tracks": [track("1")]})
        assert posted.status_code == 202
        assert api.http.get("/healthz").status_code == 200
        second = worker("second.log")  # as the unit does
        try:
            wait_for(lambda: api.http.get("/readyz").json()["queue_lag_s"] == 0)
        finally:
            second.terminate()
            assert second.wait(30) == 0
