"""Hundreds of cameras at work on one machine: how old their estimates get.

    python -m tests.benchmarks.cameras [--cameras 500] [--minutes 20] [--workers 2]

Each camera has its reference, a full window of 400 people, and posts one more every 5 s, in a
request of its own. They are copies of a few simulated streets. Clients and readers of poses and
pages share the machine with the service. Exits with 1 where estimates or answers come too late.
"""

import argparse
import asyncio
import json
import multiprocessing
import random
import sys
import tempfile
import threading
import time
from collections import Counter, defaultdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from models.tracks.trajectory import Trajectory
from service.settings import Settings
from service.store.engines.files import connected
from tests.benchmarks.load import quantiles
from tests.benchmarks.parts.cloned import APART_S, QUEUED, as_posted, camera_at, seed
from tests.benchmarks.parts.http_client import Connection
from tests.running import RunningService, free_port, wait_for

_READS_HZ, _PAGES_HZ = 10.0, 0.1
_OLDEST_S, _POSTS_P99_MS, _READS_P99_MS, _PAGE_S, _MEMORY_MB = 60.0, 150.0, 25.0, 2.0, 800.0
_SAMPLES_S = 10.0
_AGES = (
    "SELECT c.id, (SELECT created_at FROM estimates e WHERE e.camera_id = c.id "
    "ORDER BY e.id DESC LIMIT 1) FROM cameras c"
)


class Clients:
    """Trackers that post at their times, and readers, as long as they are let."""

    def __init__(self, port: int, walks: list[list[Trajectory]], cameras: int) -> None:
        self._port, self._walks, self._cameras = port, walks, cameras
        self._random = random.Random(0)
        self.answers: Counter[str] = Counter()
        self.seconds: dict[str, list[float]] = defaultdict(list)

    async def run(self, until: float) -> None:
        """Ask until a time of the monotonic clock."""
        async with asyncio.TaskGroup() as group:
            for number in range(self._cameras):
                group.create_task(self._tracker(number, until))
            group.create_task(self._reader("reads", _READS_HZ, until))
            group.create_task(self._reader("pages", _PAGES_HZ, until))

    async def _tracker(self, number: int, until: float) -> None:
        connection = Connection("127.0.0.1", self._port)
        camera_id, site = camera_at(number)
        due = time.monotonic() + APART_S * self._random.random()
        while due < until:
            await asyncio.sleep(max(0.0, due - time.monotonic()))
            walk = self._random.choice(self._walks[site])
            posted = as_posted(walk, f"{due:.3f}", time.time())
            body = json.dumps({"source": "a", "tracks": [posted]}).encode()
            await self._ask("posts", connection, f"/cameras/{camera_id}/tracks", due, body)
            due += APART_S
        connection.close()

    async def _reader(self, kind: str, often_hz: float, until: float) -> None:
        connection = Connection("127.0.0.1", self._port)
        due = time.monotonic()
        while (due := due + self._random.expovariate(often_hz)) < until:
            await asyncio.sleep(max(0.0, due - time.monotonic()))
            camera_id, _ = camera_at(self._random.randrange(self._cameras))
            pages = ("/", f"/ui/cameras/{camera_id}")
            path = f"/cameras/{camera_id}/pose" if kind == "reads" else self._random.choice(pages)
            await self._ask(kind, connection, path, max(due, time.monotonic()))
        connection.close()

    async def _ask(
        self, kind: str, connection: Connection, path: str, due: float, body: bytes = b""
    ) -> None:
        answer = await connection.ask("POST" if body else "GET", path, body)
        self.answers[f"{kind} {answer.status} {answer.problem}".strip()] += 1
        self.seconds[kind].append(time.monotonic() - due)


def clients(
    port: int, walks: list[list[Trajectory]], cameras: int, lasts_s: float, out: Any
) -> None:
    """The clients, in a process of their own: what they wait for themselves is not the server's."""
    asked = Clients(port, walks, cameras)
    asyncio.run(asked.run(time.monotonic() + lasts_s))
    out.send((asked.answers, dict(asked.seconds)))


class Watch(threading.Thread):
    """The ages of the newest estimates, the queue, and memory, every few seconds."""

    def __init__(self, pid: int, database: Path) -> None:
        super().__init__(daemon=True)
        self._process, self._database = psutil.Process(pid), database
        self._stop_now = threading.Event()
        self.ages_s: list[np.ndarray] = []
        self.queued: list[int] = []
        self.memory_mb: list[float] = []

    def run(self) -> None:
        """Look until told to stop."""
        while not self._stop_now.wait(_SAMPLES_S):
            with connected(self._database) as connection:
                made = [row[1] for row in connection.execute(_AGES)]
                self.queued.append(connection.execute(QUEUED).fetchone()[0])
            now = datetime.now(UTC)
            then = [datetime.fromisoformat(each).replace(tzinfo=UTC) for each in made]
            self.ages_s.append(np.array([(now - each).total_seconds() for each in then]))
            self.memory_mb.append(sum(self.memory().values()))

    def processes(self) -> dict[str, psutil.Process]:
        """The service's, by what they are."""
        children = self._process.children(recursive=True)
        return {"serve": self._process} | {
            f"{' '.join(child.cmdline()[3:6])} ({child.pid})": child for child in children
        }

    def memory(self) -> dict[str, float]:
        """MB of each; of what it shares with others, its part."""
        return {name: p.memory_full_info().pss / 2**20 for name, p in self.processes().items()}

    def cpu_s(self) -> dict[str, float]:
        """Seconds of each so far."""
        return {name: sum(p.cpu_times()[:2]) for name, p in self.processes().items()}

    def stop(self) -> None:
        """Stop looking."""
        self._stop_now.set()
        self.join()


def main() -> int:
    """Seed, serve, ask, and print what came of it; 0 where all was in time."""
    ask = argparse.ArgumentParser(description=__doc__)
    ask.add_argument("--cameras", type=int, default=500)
    ask.add_argument("--minutes", type=float, default=20.0)
    ask.add_argument("--workers", type=int, default=2)
    wanted = ask.parse_args()
    with tempfile.TemporaryDirectory(prefix="surefoot-cameras-") as folder:
        settings = Settings(
            data_dir=Path(folder) / "data",
            port=free_port(),
            workers=wanted.workers,
            trainings="off",  # the served pose needs none
            caller_rate=0,  # all cameras have one address here
            connections_per_address=0,
            max_connections=2 * wanted.cameras + 100,
        )
        walks = seed(settings, wanted.cameras)
        service = RunningService(settings, forked=False)
        service.start()
        try:
            wait_for(service.ready)
            report = _run(service, walks, wanted)
        finally:
            service.stop()
    json.dump(report, sys.stdout, indent=1)
    sys.stdout.write("\n")
    return 1 if report["failed"] else 0


def _run(
    service: RunningService, walks: list[list[Trajectory]], wanted: argparse.Namespace
) -> dict[str, Any]:
    lasts_s = 60 * wanted.minutes
    watch = Watch(service.process.pid, service.settings.database_path)
    context = multiprocessing.get_context("spawn")
    mine, theirs = context.Pipe()
    arguments = (service.settings.port, walks, wanted.cameras, lasts_s, theirs)
    asking = context.Process(target=clients, args=arguments)
    before, begun_s = watch.cpu_s(), time.monotonic()
    watch.start()
    asking.start()
    answers, seconds = mine.recv()
    asking.join()
    took_s, after, memory = time.monotonic() - begun_s, watch.cpu_s(), watch.memory()
    watch.stop()
    with connected(service.settings.database_path) as connection:
        query = "SELECT count(*) FROM estimates WHERE created_at > ?"
        since = datetime.fromtimestamp(time.time() - took_s, UTC).strftime("%Y-%m-%d %H:%M:%S")
        estimates = connection.execute(query, (since,)).fetchone()[0]
    # Copies were all looked at when the copy was made: what they begin with is not the service's.
    ages = watch.ages_s[int(_OLDEST_S / _SAMPLES_S) :] or watch.ages_s[-1:]
    latency = {kind: quantiles(found) for kind, found in seconds.items()}
    cpu = {name: round(spent - before.get(name, 0.0), 1) for name, spent in after.items()}
    oldest_s = float(max(age.max() for age in ages))
    failed = [name for name in answers if " 200" not in name and " 202" not in name]
    if oldest_s > _OLDEST_S:
        failed.append(f"an estimate was {oldest_s:.0f} s old, {_OLDEST_S:g} s are the limit")
    for kind, limit_ms in (("posts", _POSTS_P99_MS), ("reads", _READS_P99_MS)):
        if latency[kind]["p99_ms"] > limit_ms:
            failed.append(f"{kind}: p99 {latency[kind]['p99_ms']} ms of {limit_ms:g}")
    if max(watch.memory_mb) > _MEMORY_MB:
        failed.append(f"{max(watch.memory_mb):.0f} MB of {_MEMORY_MB:g}")
    worst_page_s = latency["pages"]["worst_ms"] / 1000 if "pages" in latency else 0.0
    if worst_page_s > _PAGE_S:
        failed.append(f"a page took {worst_page_s:.1f} s of {_PAGE_S:g}")
    return {
        "cameras": wanted.cameras,
        "minutes": round(took_s / 60, 1),
        "answers": dict(answers),
        "latency": latency,
        "estimates": estimates,
        "worker_cpu_s_an_estimate": round(
            sum(spent for name, spent in cpu.items() if name != "serve") / max(estimates, 1), 3
        ),
        "oldest_estimate_s": round(oldest_s, 1),
        "median_age_s_by_minute": [round(float(np.median(age)), 1) for age in watch.ages_s[::6]],
        "oldest_s_by_minute": [round(float(age.max()), 1) for age in watch.ages_s[::6]],
        "queued_by_minute": watch.queued[::6],
        "cpu_s": cpu,
        "memory_mb": {name: round(mb) for name, mb in memory.items()},
        "failed": failed,
    }


if __name__ == "__main__":
    sys.exit(main())
