"""Several machines over one PostgreSQL database: each is a data directory and processes of its own.

Nothing that was acknowledged is lost, no camera is looked at twice at once, and all goes on.
"""

import random
import signal
import threading
import time
from contextlib import contextmanager
from dataclasses import dataclass, field

import httpx
import psutil
import pytest

from service.settings import Settings
from service.store.engines.postgresql import LOCKS, lock_key
from service.workers.processes.workers import worker_name
from tests.conftest import CAMERA, track
from tests.running import RunningService, free_port, wait_for
from tests.stores import server as servers
from tests.stores.databases import ask
from tests.stores.server import Server

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not servers.wanted(), reason="PostgreSQL only"),
]
CAMERAS = [f"c{n}" for n in range(4)]


@pytest.fixture
def server():
    """A server that a test may stop."""
    made = Server()
    made.start()
    yield made
    made.remove()


@contextmanager
def machine(folder, number, url):
    """A machine with one API and a worker of its own."""
    settings = Settings(
        data_dir=folder / f"machine-{number}" / "data",
        database_url=url,
        secret_key="A" * 43 + "=",
        port=free_port(),
        trainings="off",
        worker_nice=0,
        worker_lost_s=3,
        reconcile_s=1,
    )
    settings.data_dir.mkdir(parents=True)
    running = RunningService(settings)
    running.start()
    try:
        yield running
    finally:
        running.stop()


@dataclass
class Tracker:
    """Posts tracks to any of the machines, again until they are acknowledged."""

    urls: list[str]
    acknowledged: dict[str, set[str]] = field(default_factory=dict)
    stopping: threading.Event = field(default_factory=threading.Event)

    def run(self, camera_id):
        taken = self.acknowledged.setdefault(camera_id, set())
        for number in range(100_000):
            if self.stopping.wait(0.05):
                return
            start_s = time.time() - 60
            body = {"source": "t", "tracks": [track(f"{number}", start_s=start_s)]}
            if self._post(camera_id, body):
                taken.add(f"{number}")

    def _post(self, camera_id, body):
        while not self.stopping.is_set():
            try:
                url = f"{random.choice(self.urls)}/cameras/{camera_id}/tracks"
                if httpx.post(url, json=body, timeout=10).status_code == 202:
                    return True
            except httpx.TransportError:
                pass
            self.stopping.wait(0.1)
        return False


class Overlaps:
    """Looks at how many jobs of each camera run at once."""

    def __init__(self, settings):
        self.settings, self.found, self.looks = settings, [], 0

    def look(self):
        rows = ask(
            self.settings,
            "SELECT deduplication_id, count(*) FROM dbos.workflow_status WHERE status = 'PENDING' "
            "AND queue_name = 'estimate' GROUP BY deduplication_id HAVING count(*) > 1",
        )
        self.looks += 1
        self.found += rows


def test_machines_die_and_the_server_restarts(tmp_path, server):
    url = servers.make(server.url(), "site")
    with machine(tmp_path, 0, url) as one, machine(tmp_path, 1, url) as two:
        for camera_id in CAMERAS:
            one.http.post("/cameras", json={**CAMERA, "id": camera_id}).raise_for_status()
        wait_for(one.ready)
        wait_for(two.ready)
        tracker, overlaps = Tracker([one.url, two.url]), Overlaps(one.settings)
        posting = [threading.Thread(target=tracker.run, args=(each,)) for each in CAMERAS]
        for thread in posting:
            thread.start()
        rng = random.Random(7)
        for turn in range(6):
            overlaps.look()
            if turn == 3:
                server.stop("fast")
                time.sleep(2)
                server.start()
            else:
                hit = rng.choice([one, two])
                for child in psutil.Process(hit.process.pid).children():
                    child.send_signal(signal.SIGKILL)
            time.sleep(2)
        wait_for(lambda: one.ready() and two.ready(), timeout_s=60)
        tracker.stopping.set()
        for thread in posting:
            thread.join(30)
        for camera_id in CAMERAS:
            rows = ask(one.settings, f"SELECT track_id FROM tracks WHERE camera_id = '{camera_id}'")
            stored = {row[0] for row in rows}
            assert len(rows) == len(stored)
            assert tracker.acknowledged[camera_id] <= stored
        wait_for(lambda: nothing_waits(one.settings), timeout_s=60)
        assert overlaps.found == []
        assert sum(map(len, tracker.acknowledged.values())) > 100
        holders = ask(one.settings, held("rounds"))
        assert len(holders) == 1  # one worker of both does the upkeep


def nothing_waits(settings):
    return not ask(settings, "SELECT id FROM cameras WHERE estimate_due_at IS NOT NULL")


def held(name):
    return (
        f"SELECT pid FROM pg_locks WHERE locktype = 'advisory' AND classid = {LOCKS} "
        f"AND objid = {lock_key(name)} AND granted"
    )


def test_a_machine_that_is_gone_is_noticed_and_not_missed(tmp_path, server):
    url = servers.make(server.url(), "site")
    with machine(tmp_path, 0, url) as one, machine(tmp_path, 1, url) as two:
        wait_for(one.ready)
        name = worker_name(two.settings, "local-0")
        wait_for(lambda: ask(two.settings, f"SELECT lost FROM workers WHERE name = '{name}'"))
        worker = psutil.Process(two.worker_pid())
        two.process.send_signal(signal.SIGKILL)
        worker.send_signal(signal.SIGKILL)
        gone_s = time.monotonic()
        one.http.post("/cameras", json=CAMERA).raise_for_status()
        one.http.post("/cameras/corner/tracks", json={"tracks": [track("a")]}).raise_for_status()
        lost = f"SELECT name FROM workers WHERE name = '{name}' AND lost"
        wait_for(lambda: ask(one.settings, lost), timeout_s=30)
        wait_for(lambda: nothing_waits(one.settings), timeout_s=30)
        assert time.monotonic() - gone_s < 30
        assert one.ready()
