"""A city's cameras at full event rate, with estimates that cost nothing: where is the wall?

    python -m tests.benchmarks.city [--cameras 10000] [--minutes 5] [--apis 2] [--workers 2]

A track each 5 s and camera, in batches of ten, to APIs that share a PostgreSQL server of this run's
own, which makes sure of each commit; a look of a worker finds what was made up, one camera in 500
moved. All of it is on this machine, the clients, too: what each costs is measured by its processes.
"""

import argparse
import json
import multiprocessing
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import psutil
import psycopg
from rich.console import Console

from service.commands.postgresql.moving import move
from service.settings import Settings
from tests.benchmarks.city.people import ask_for
from tests.benchmarks.city.seeding import seed_file
from tests.benchmarks.databases import cpu_s
from tests.benchmarks.load import quantiles
from tests.running import RunningService, free_port
from tests.stores.server import Server

_APART_S, _SAMPLES_S = 5.0, 5.0
_SAMPLED = (
    "queued",
    "estimates",
    "tracks",
    "alerts",
    "longest_due_s",
    "connections",
    "locks_waited_for",
)
_SAMPLE = """
SELECT (SELECT count(*) FROM workflow_status WHERE status IN ('ENQUEUED', 'PENDING')
            AND queue_name = 'estimate'),
       (SELECT count(*) FROM estimates),
       (SELECT count(*) FROM tracks),
       (SELECT count(*) FROM alerts),
       (SELECT coalesce(extract(epoch FROM now() - min(estimate_due_at)), 0) FROM cameras),
       (SELECT count(*) FROM pg_stat_activity WHERE datname = current_database()),
       (SELECT count(*) FROM pg_locks WHERE NOT granted)
"""


class Watch(threading.Thread):
    """What the server has, every few seconds."""

    def __init__(self, url: str) -> None:
        super().__init__(daemon=True)
        self._url, self._over = url, threading.Event()
        self.rows: list[dict[str, float]] = []

    def run(self) -> None:
        with psycopg.connect(self._url, autocommit=True) as connection:
            connection.execute("SET search_path TO public, dbos")
            begun_s = time.monotonic()
            while True:
                row = connection.execute(_SAMPLE).fetchone()
                assert row is not None
                at_s = round(time.monotonic() - begun_s)
                self.rows.append(
                    {"at_s": at_s, **dict(zip(_SAMPLED, map(float, row), strict=True))}
                )
                if self._over.wait(_SAMPLES_S):
                    return

    def stop(self) -> None:
        """Look once more, and stop."""
        self._over.set()
        self.join()


def main() -> None:
    """Seed, serve, ask, and print what came of it."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--cameras", type=int, default=10_000)
    asked.add_argument("--minutes", type=float, default=5.0)
    asked.add_argument("--batch", type=int, default=10)
    asked.add_argument("--apis", type=int, default=2)
    asked.add_argument("--workers", type=int, default=2)
    wanted = asked.parse_args()
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="surefoot-city-")))
        server = Server(durable=True)
        server.start()
        stack.callback(server.remove)
        report = _run(stack, folder, server, wanted)
    json.dump(report, sys.stdout, indent=1)
    sys.stdout.write("\n")


def _run(
    stack: ExitStack, folder: Path, server: Server, wanted: argparse.Namespace
) -> dict[str, Any]:
    told = Console(stderr=True)
    begun_s = time.monotonic()
    source = seed_file(folder / "seed", wanted.cameras)
    settings = [
        Settings(
            data_dir=folder / f"machine-{n}",
            database_url=server.url(),
            secret_key="MDEyMzQ1Njc4OTAxMjM0NTY3ODkwMTIzNDU2Nzg5MDE=",
            port=free_port(),
            workers=0,
            trainings="off",
            max_cameras=10 * wanted.cameras,
            caller_rate=0,
            connections_per_address=0,
        )
        for n in range(max(wanted.apis, wanted.workers))
    ]
    seeded_s = time.monotonic() - begun_s
    move(source, settings[0], lambda *_: None)
    moved_s = time.monotonic() - begun_s - seeded_s
    told.print(f"{wanted.cameras} cameras made in {seeded_s:.0f} s, moved in {moved_s:.0f} s")
    services = [RunningService(each, forked=False) for each in settings[: wanted.apis]]
    for service in services:
        service.start()
        stack.callback(service.stop)
    workers = []
    for n in range(wanted.workers):
        command = [sys.executable, "-m", "tests.benchmarks.city.stub", f"stub-{n}"]
        with (folder / f"worker-{n}.log").open("w") as log:
            worker = subprocess.Popen(
                command, env=settings[n].as_environment(), stdout=log, stderr=log
            )
        stack.callback(worker.wait)
        stack.callback(worker.kill)
        workers.append(worker)
    groups = {
        "apis": [service.process.pid for service in services],
        "workers": [worker.pid for worker in workers],
        "server": [server.pid],
    }
    watch = Watch(server.url())
    watch.start()
    size_b = _size_b(server)
    before = {name: cpu_s(pids) for name, pids in groups.items()}
    lasts_s = 60 * wanted.minutes
    context = multiprocessing.get_context("spawn")
    mine, theirs = context.Pipe()
    ports = [service.settings.port for service in services]
    arguments = (ports, wanted.cameras, wanted.batch, _APART_S, lasts_s, theirs)
    asking = context.Process(target=ask_for, args=arguments)
    asking.start()
    answers, seconds, events = mine.recv()
    clients_s = sum(psutil.Process(asking.pid).cpu_times()[:2])
    asking.join()
    watch.stop()
    spent = {name: cpu_s(pids) - before[name] for name, pids in groups.items()}
    first, last = watch.rows[0], watch.rows[-1]
    took_s = last["at_s"] - first["at_s"]
    tracks, looks = last["tracks"] - first["tracks"], last["estimates"] - first["estimates"]
    return {
        "cameras": wanted.cameras,
        "seconds": took_s,
        "moved_from_sqlite_s": round(moved_s, 1),
        "answers": dict(answers),
        "latency": {kind: quantiles(found) for kind, found in seconds.items()},
        "events": dict(events),
        "tracks_a_second": round(tracks / took_s),
        "looks_a_second": round(looks / took_s, 1),
        "alerts": last["alerts"],
        "cpu_s": {**{name: round(s, 1) for name, s in spent.items()}, "clients": clients_s},
        "bytes_a_track": round((_size_b(server) - size_b) / max(tracks, 1)),
        "most": {name: max(row[name] for row in watch.rows) for name in watch.rows[0]},
        "by_time": watch.rows[:: max(len(watch.rows) // 12, 1)],
    }


def _size_b(server: Server) -> int:
    with psycopg.connect(server.url(), autocommit=True) as connection:
        row = connection.execute("SELECT pg_total_relation_size('tracks')").fetchone()
    assert row is not None
    return int(row[0])


if __name__ == "__main__":
    main()
