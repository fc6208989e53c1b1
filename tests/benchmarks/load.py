"""Open-loop load on a service of its own: `python -m tests.benchmarks.load --minutes 30`.

Requests come when they come, whether or not those before are answered. Exits with 1 on any 5xx but
503 with Retry-After, on silence, and where memory or the WAL do not stay within their bounds.
"""

import argparse
import asyncio
import gc
import json
import random
import sys
import tempfile
import threading
import time
from collections import Counter, defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from service.commands.migrate import migrate
from service.settings import Settings
from tests.benchmarks.parts.health_probe import probing
from tests.benchmarks.parts.http_client import Answer, Connection
from tests.conftest import CAMERA
from tests.running import RunningService, free_port

_AT_ONCE = 8  # requests of a client that wait for an answer; beyond, an arrival is not sent
_READS = ("/cameras/load-{}/pose", "/cameras/load-{}", "/alerts", "/cameras", "/")
_WARM_S = 300.0


class Load:
    """Clients with arrivals at random, and what became of their requests."""

    def __init__(self, port: int, cameras: int, seed: int) -> None:
        self._port, self._cameras = port, cameras
        self._random = random.Random(seed)
        self._number = 0
        self.counts: dict[str, Counter[str]] = defaultdict(Counter)
        self.seconds: dict[str, list[float]] = defaultdict(list)
        self.bad: list[str] = []

    async def run(self, clients: int, posts_hz: float, reads_hz: float, until: float) -> None:
        """Ask until a time, then wait for the answers."""
        async with asyncio.TaskGroup() as group:
            for _ in range(clients):
                group.create_task(self._client(posts_hz / clients, reads_hz / clients, until))

    async def _client(self, posts_hz: float, reads_hz: float, until: float) -> None:
        idle = [Connection("127.0.0.1", self._port) for _ in range(_AT_ONCE)]
        total_hz = posts_hz + reads_hz
        async with asyncio.TaskGroup() as group:
            due = time.monotonic()
            while (due := due + self._random.expovariate(total_hz)) < until:
                await asyncio.sleep(max(0.0, due - time.monotonic()))
                post = self._random.random() < posts_hz / total_hz
                if idle:
                    group.create_task(self._request(idle, post, due))
                else:
                    self.counts["posts" if post else "reads"]["not sent"] += 1
        for connection in idle:
            connection.close()

    async def _request(self, idle: list[Connection], post: bool, due: float) -> None:
        connection = idle.pop()
        camera = self._random.randrange(self._cameras)
        if post:
            path = f"/cameras/load-{camera}/tracks"
            answer = await connection.ask("POST", path, self._body())
        else:
            path = self._random.choice(_READS).format(camera)
            answer = await connection.ask("GET", path)
        idle.append(connection)
        self._note("posts" if post else "reads", path, answer, time.monotonic() - due)

    def _note(self, kind: str, path: str, answer: Answer, seconds: float) -> None:
        name = f"{answer.status} {answer.problem}".strip()
        self.counts[kind][name] += 1
        self.seconds[f"{kind} {'answered' if answer.status < 300 else 'refused'}"].append(seconds)
        told = answer.status in (503, 429) and answer.retry_after
        if answer.status == 0 or (answer.status >= 400 and not told):
            self.bad.append(f"{path}: {name}")

    def _body(self) -> bytes:
        self._number += 1
        start_s = time.time() - 10
        v = 350.0 + self._random.uniform(0, 200)
        points = [[start_s + 0.4 * n, 300.0 + 12 * n, v + 5 * n] for n in range(20)]
        track = {"id": str(self._number), "points": points}
        return json.dumps({"source": "load", "tracks": [track]}).encode()


class Watch(threading.Thread):
    """Memory of every process of the service, and the size of its WAL, twice a second."""

    def __init__(self, pid: int, settings: Settings) -> None:
        super().__init__(daemon=True)
        self._process, self._settings = psutil.Process(pid), settings
        self._stop_now = threading.Event()
        self.rss: dict[str, list[tuple[float, float]]] = defaultdict(list)
        self.largest_wal_mb = 0.0

    def run(self) -> None:
        """Look until told to stop."""
        begun, wal = time.monotonic(), Path(f"{self._settings.database_path}-wal")
        while not self._stop_now.wait(0.5):
            at_s = time.monotonic() - begun
            for process in [self._process, *self._process.children(recursive=True)]:
                try:
                    kind = " ".join(process.cmdline()[3:6]) or process.name()
                    name = f"{kind} ({process.pid})"
                    self.rss[name].append((at_s, process.memory_info().rss / 2**20))
                except psutil.Error:  # it has just ended
                    continue
            if wal.exists():
                self.largest_wal_mb = max(self.largest_wal_mb, wal.stat().st_size / 2**20)

    def stop(self) -> None:
        """Stop looking."""
        self._stop_now.set()
        self.join()


def quantiles(seconds: list[float]) -> dict[str, float]:
    """p50, p99 and worst in milliseconds."""
    ms = 1000 * np.array(seconds or [float("nan")])
    p50, p99 = np.percentile(ms, [50, 99])
    return {"p50_ms": round(p50, 1), "p99_ms": round(p99, 1), "worst_ms": round(ms.max(), 1)}


def growth(samples: list[tuple[float, float]], warm_s: float) -> dict[str, Any]:
    """Memory right after the warm time, at the end (medians of a tenth each) and at its most.

    `by_minute_mb` has the least of every minute: what is held, without what a job needs for itself.
    """
    mb = np.array([rss for at_s, rss in samples if at_s >= warm_s] or [samples[-1][1]])
    tenth = max(1, len(mb) // 10)
    first, last = float(np.median(mb[:tenth])), float(np.median(mb[-tenth:]))
    ratio = round(last / first - 1, 4)
    least: dict[int, float] = {}
    for at_s, rss in samples:
        minute = int(at_s // 60)
        least[minute] = min(least.get(minute, rss), rss)
    return {
        "warm_mb": round(first),
        "end_mb": round(last),
        "most_mb": round(mb.max()),
        "growth": ratio,
        "by_minute_mb": " ".join(str(round(rss)) for rss in least.values()),
    }


def main() -> int:
    """Start a service, load it, print a report; 0 if it kept what it must."""
    ask = argparse.ArgumentParser(description=__doc__)
    ask.add_argument("--clients", type=int, default=64)
    ask.add_argument("--minutes", type=float, default=1.0)
    ask.add_argument("--rate", type=float, default=100.0, help="posts a second, of all clients")
    ask.add_argument("--reads", type=float, default=10.0, help="reads a second")
    ask.add_argument("--cameras", type=int, default=8)
    ask.add_argument("--workers", type=int, default=1)
    ask.add_argument("--seed", type=int, default=0)
    ask.add_argument("--health-ms", type=float, default=100.0)
    ask.add_argument("--wal-mb", type=float, default=64.0)
    ask.add_argument("--growth", type=float, default=0.05)
    wanted = ask.parse_args()
    with tempfile.TemporaryDirectory(prefix="surefoot-load-") as folder:
        settings = Settings(
            data_dir=Path(folder) / "data", port=free_port(), workers=wanted.workers, epochs=1
        )
        migrate(settings)
        service = RunningService(settings, forked=False)
        service.start()
        try:
            report = _run(service, wanted)
        finally:
            service.stop()
    json.dump(report, sys.stdout, indent=1)
    sys.stdout.write("\n")
    return 1 if report["failed"] else 0


def _run(service: RunningService, wanted: argparse.Namespace) -> dict[str, object]:
    port = service.settings.port
    for n in range(wanted.cameras):
        service.http.post("/cameras", json={**CAMERA, "id": f"load-{n}"}).raise_for_status()
    # A worker holds the networks once the first training has ended: not a thing of the load.
    trained_s = _seconds_until(lambda: not _training(service, wanted.cameras), most_s=900)
    load = Load(port, wanted.cameras, wanted.seed)
    watch = Watch(service.process.pid, service.settings)
    watch.start()
    lasts_s = 60 * wanted.minutes
    with probing(port) as ended:
        gc.freeze()  # nor is what the clients wait for themselves the server's delay
        asyncio.run(load.run(wanted.clients, wanted.rate, wanted.reads, time.monotonic() + lasts_s))
        after = _seconds_until(lambda: service.http.get("/readyz").json()["store_writable"])
        probes = ended()
    health = [probe.health_s for probe in probes]
    slowest = sorted(probes, key=lambda probe: probe.health_s)[-8:]
    watch.stop()
    warm_s = min(_WARM_S, lasts_s / 2)
    memory = {name: growth(samples, warm_s) for name, samples in watch.rss.items()}
    stored = sum(
        service.http.get(f"/cameras/load-{n}").json()["tracks"] for n in range(wanted.cameras)
    )
    accepted = load.counts["posts"]["202"]
    failed = list(dict.fromkeys(load.bad))[:20]
    if stored < min(accepted, service.settings.keep_tracks):
        failed.append(f"{accepted} tracks acknowledged, {stored} stored")
    if 1000 * max(health) > wanted.health_ms:
        failed.append(f"/healthz took {1000 * max(health):.0f} ms")
    if watch.largest_wal_mb > wanted.wal_mb:
        failed.append(f"the WAL grew to {watch.largest_wal_mb:.0f} MB")
    if lasts_s > _WARM_S:
        failed += [
            f"{name} grew by {100 * found['growth']:.1f} %"
            for name, found in memory.items()
            if found["growth"] > wanted.growth
        ]
    return {
        "trained_before_s": round(trained_s),
        "counts": {kind: dict(found) for kind, found in load.counts.items()},
        "latency": {kind: quantiles(found) for kind, found in load.seconds.items()},
        "health": quantiles(health),
        "health_slowest": [
            f"{1000 * probe.health_s:.0f} ms at {probe.at_s:.0f} s, "
            f"{1000 * probe.idle_s:.0f} ms of the idle server"
            for probe in slowest
        ],
        "idle_server": quantiles([probe.idle_s for probe in probes]),
        "well_again_after_s": round(after, 2),
        "memory": memory,
        "largest_wal_mb": round(watch.largest_wal_mb, 1),
        "tracks_stored": stored,
        "failed": failed,
    }


def _training(service: RunningService, cameras: int) -> bool:
    listed = (service.http.get(f"/cameras/load-{n}/trainings").json() for n in range(cameras))
    return any(
        item["state"] in ("queued", "running") for answer in listed for item in answer["items"]
    )


def _seconds_until(what: Callable[[], bool], most_s: float = 60.0) -> float:
    begun = time.monotonic()
    while not what() and time.monotonic() - begun < most_s:
        time.sleep(0.05)
    return time.monotonic() - begun


if __name__ == "__main__":
    sys.exit(main())
