"""Hundreds of cameras on one machine: how soon tracks are monitored, and what that costs.

    python -m tests.benchmarks.cameras [--cameras 500] [--minutes 20] [--every 5] [--workers 2]

Each camera has its reference and a full window of 400 tracks, and posts one more track every few
seconds, in a request of its own. The cameras are copies of a few simulated streets. Ten of them are
knocked after a tenth of the time. Clients and readers of poses and pages share the machine with the
service. Exits with 1 if tracks, alerts or answers come too late, or memory is above its limit.
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
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import psutil
from prometheus_client.parser import text_string_to_metric_families

from models.tracks.trajectory import Trajectory
from service.settings import Settings
from service.store.engines.files import connected
from service.workers.heartbeat import BEAT_S
from tests.benchmarks.load import quantiles
from tests.benchmarks.parts.cloned import APART_S, QUEUED, as_posted, camera_at, people, seed
from tests.benchmarks.parts.http_client import Connection
from tests.benchmarks.parts.monitored import CheckWatch, count_estimates, delays_s, knock_alerts
from tests.running import RunningService, free_port, wait_for
from tests.service.street import KNOCKED

_READS_HZ, _PAGES_HZ = 10.0, 0.1
_POSTS_P99_MS, _READS_P99_MS, _PAGE_S, _MEMORY_MB = 150.0, 25.0, 2.0, 1024.0
_MONITORED_S, _MONITORED_SHARE, _ALERT_S = 10.0, 0.95, 10.0
_SAMPLES_S = 5.0
_KNOCKED = 10  # cameras
_KNOCKED_AFTER = 0.1  # of the time
_RUNS, _CPU_S = "surefoot_estimation_runs_total", "surefoot_estimation_cpu_seconds_total"


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """What the clients post: a track of each camera `every_s`; the last cameras are knocked.

    `walks` and `knocked_walks` are of each street, before and after the knock at `knocked_s`, in
    seconds of the clock.
    """

    walks: list[list[Trajectory]]
    knocked_walks: list[list[Trajectory]]
    cameras: int
    every_s: float
    knocked_s: float
    ends_s: float

    @property
    def knocked(self) -> range:
        """The numbers of the cameras that are knocked."""
        return range(max(self.cameras - _KNOCKED, 0), self.cameras)


class Clients:
    """Trackers that post at their times, and readers, until the plan ends."""

    def __init__(self, port: int, plan: Plan) -> None:
        self._port, self._plan = port, plan
        self._random = random.Random(0)
        self.answers: Counter[str] = Counter()
        self.seconds: dict[str, list[float]] = defaultdict(list)

    async def run(self, until: float) -> None:
        """Ask until a time of the monotonic clock."""
        async with asyncio.TaskGroup() as group:
            for number in range(self._plan.cameras):
                group.create_task(self._tracker(number, until))
            group.create_task(self._reader("reads", _READS_HZ, until))
            group.create_task(self._reader("pages", _PAGES_HZ, until))

    async def _tracker(self, number: int, until: float) -> None:
        connection = Connection("127.0.0.1", self._port)
        camera_id, site = camera_at(number)
        due = time.monotonic() + self._plan.every_s * self._random.random()
        while due < until:
            await asyncio.sleep(max(0.0, due - time.monotonic()))
            is_knocked = number in self._plan.knocked and time.time() >= self._plan.knocked_s
            walks = self._plan.knocked_walks if is_knocked else self._plan.walks
            walk = self._random.choice(walks[site])
            posted = as_posted(walk, f"{due:.3f}", time.time())
            body = json.dumps({"source": "a", "tracks": [posted]}).encode()
            await self._ask("posts", connection, f"/cameras/{camera_id}/tracks", due, body)
            due += self._plan.every_s
        connection.close()

    async def _reader(self, kind: str, often_hz: float, until: float) -> None:
        connection = Connection("127.0.0.1", self._port)
        due = time.monotonic()
        while (due := due + self._random.expovariate(often_hz)) < until:
            await asyncio.sleep(max(0.0, due - time.monotonic()))
            camera_id, _ = camera_at(self._random.randrange(self._plan.cameras))
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


def clients(port: int, plan: Plan, out: Any) -> None:
    """Run the clients in a process of their own, so that their delays are not the service's."""
    asked = Clients(port, plan)
    asyncio.run(asked.run(time.monotonic() + plan.ends_s - time.time()))
    out.send((asked.answers, dict(asked.seconds)))


class Watch(threading.Thread):
    """The queue, memory and the size of the WAL, every few seconds."""

    def __init__(self, pid: int, database: Path) -> None:
        super().__init__(daemon=True)
        self._process, self._database = psutil.Process(pid), database
        self._stop_now = threading.Event()
        self.queued: list[int] = []
        self.memory_mb: list[float] = []
        self.wal_mb: list[float] = []

    def run(self) -> None:
        """Sample until stopped."""
        wal = Path(f"{self._database}-wal")
        while not self._stop_now.wait(_SAMPLES_S):
            with connected(self._database) as connection:
                self.queued.append(connection.execute(QUEUED).fetchone()[0])
            self.memory_mb.append(sum(self.memory().values()))
            self.wal_mb.append(wal.stat().st_size / 2**20 if wal.exists() else 0.0)

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
        """Stop sampling."""
        self._stop_now.set()
        self.join()


def main() -> int:
    """Seed, serve, post and read, and print the report; 0 if all limits were kept."""
    ask = argparse.ArgumentParser(description=__doc__)
    ask.add_argument("--cameras", type=int, default=500)
    ask.add_argument("--minutes", type=float, default=20.0)
    ask.add_argument(
        "--every", type=float, default=APART_S, metavar="S", help="seconds between tracks"
    )
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
    database, lasts_s = service.settings.database_path, 60 * wanted.minutes
    watch, checks = Watch(service.process.pid, database), CheckWatch(database)
    knocked_walks = [people(site, len(walks[0]), KNOCKED) for site in range(len(walks))]
    context = multiprocessing.get_context("spawn")
    mine, theirs = context.Pipe()
    watch.start()
    checks.start()
    before, runs_before, begun_s = watch.cpu_s(), _runs(service), time.time()
    plan = Plan(
        walks=walks,
        knocked_walks=knocked_walks,
        cameras=wanted.cameras,
        every_s=wanted.every,
        knocked_s=begun_s + _KNOCKED_AFTER * lasts_s,
        ends_s=begun_s + lasts_s,
    )
    asking = context.Process(target=clients, args=(service.settings.port, plan, theirs))
    asking.start()
    answers, seconds = mine.recv()
    asking.join()
    ended_s, after, memory = time.time(), watch.cpu_s(), watch.memory()
    time.sleep(2 * BEAT_S)  # workers report their runs with the next heartbeat
    runs = {name: now - runs_before.get(name, 0.0) for name, now in _runs(service).items()}
    watch.stop()
    checks.stop()
    delays, overdue = delays_s(database, checks.checks, begun_s, ended_s, _MONITORED_S)
    knocked = [camera_at(number)[0] for number in plan.knocked]
    alerts = knock_alerts(database, checks.checks, knocked, plan.knocked_s)
    in_time = sum(delay <= _MONITORED_S for delay in delays)
    share = in_time / max(len(delays) + overdue, 1)
    latency = {kind: quantiles(found) for kind, found in seconds.items()}
    cpu = {name: round(spent - before.get(name, 0.0), 1) for name, spent in after.items()}
    report = {
        "cameras": wanted.cameras,
        "seconds_between_tracks": wanted.every,
        "minutes": round((ended_s - begun_s) / 60, 1),
        "answers": dict(answers),
        "latency": latency,
        "monitored_within_10_s": round(share, 4),
        "seconds_until_monitored": quantiles_s(delays),
        "tracks_overdue_at_the_end": overdue,
        "knocked": len(knocked),
        "alerts": [asdict(alert) for alert in alerts],
        "runs": {name: round(number, 2) for name, number in runs.items()},
        "estimates_stored": count_estimates(database, begun_s),
        "cpu_s": cpu,
        "queued": watch.queued,
        "memory_mb": {name: round(mb) for name, mb in memory.items()},
        "largest_memory_mb": round(max(watch.memory_mb)),
        "largest_wal_mb": round(max(watch.wal_mb), 1),
    }
    report["failed"] = [
        *(name for name in answers if " 200" not in name and " 202" not in name),
        *_beyond_limits(report),
    ]
    return report


def _beyond_limits(report: dict[str, Any]) -> list[str]:
    failed, latency = [], report["latency"]
    if report["monitored_within_10_s"] < _MONITORED_SHARE:
        failed.append(
            f"{report['monitored_within_10_s']:.1%} of tracks were monitored within "
            f"{_MONITORED_S:g} s, at least {_MONITORED_SHARE:.0%} are needed"
        )
    if len(report["alerts"]) < report["knocked"]:
        failed.append(f"{len(report['alerts'])} of {report['knocked']} knocked cameras had alerts")
    failed += [
        f"{alert['camera_id']}: {alert['after_cause_s']:.1f} s from track to alert, of {_ALERT_S:g}"
        for alert in report["alerts"]
        if alert["after_cause_s"] > _ALERT_S
    ]
    for kind, limit_ms in (("posts", _POSTS_P99_MS), ("reads", _READS_P99_MS)):
        if latency[kind]["p99_ms"] > limit_ms:
            failed.append(f"{kind}: p99 {latency[kind]['p99_ms']} ms of {limit_ms:g}")
    if report["largest_memory_mb"] > _MEMORY_MB:
        failed.append(f"{report['largest_memory_mb']} MB of {_MEMORY_MB:g}")
    worst_page_s = latency["pages"]["worst_ms"] / 1000 if "pages" in latency else 0.0
    if worst_page_s > _PAGE_S:
        failed.append(f"a page took {worst_page_s:.1f} s of {_PAGE_S:g}")
    return failed


def _runs(service: RunningService) -> dict[str, float]:
    """Runs and CPU seconds by kind so far."""
    return {
        f"{sample.labels['kind']} {'runs' if sample.name == _RUNS else 'cpu_s'}": sample.value
        for family in text_string_to_metric_families(service.http.get("/metrics").text)
        for sample in family.samples
        if sample.name in (_RUNS, _CPU_S)
    }


def quantiles_s(found: list[float]) -> dict[str, float]:
    """p50, p95 and worst in seconds."""
    values = np.quantile(found or [float("nan")], [0.5, 0.95, 1.0])
    return dict(zip(("p50_s", "p95_s", "worst_s"), values.round(1).tolist(), strict=True))


if __name__ == "__main__":
    sys.exit(main())
