"""SQLite beside PostgreSQL with one API and two: `python -m tests.benchmarks.databases`.

One-track posts, reads of poses, and both by turns, by sixteen clients, as many as are answered; one
database after the other in each round, so that what else the machine does falls on all alike. Where
nobody posts, a pose that was read on SQLite is kept until the next commit, and on PostgreSQL it is
read again. PostgreSQL is a server of this run's own, in a temporary folder, that makes sure of each
commit as it comes out of the box.
"""

import argparse
import asyncio
import json
import sys
import tempfile
import time
from contextlib import ExitStack
from itertools import chain
from pathlib import Path
from statistics import median
from typing import NamedTuple

import psutil
from rich.console import Console
from rich.table import Table

from tests.benchmarks.requests import (
    CLIENTS,
    KINDS,
    Bodies,
    Kind,
    api_over,
    ask,
    gets,
    posts,
    register_cameras,
)
from tests.running import RunningService
from tests.stores.server import Server


def _posts_and_poses() -> Bodies:
    return chain.from_iterable(zip(posts(1)(), gets("/cameras/{}/pose")(), strict=True))


_KINDS = [
    *(kind for kind in KINDS if kind.clients == CLIENTS),
    Kind(name="a track and a pose in turns", clients=CLIENTS, asks=_posts_and_poses),
]
_SQLITE, _ONE, _TWO = "SQLite", "PostgreSQL, one API", "PostgreSQL, two APIs"


class Measured(NamedTuple):
    """Answers a second, and CPU of an answer: of the APIs, and of the database's own processes."""

    per_s: float
    api_ms: float
    server_ms: float


def cpu_s(pids: list[int]) -> float:
    """What processes have computed, and those that they have started."""
    total = 0.0
    for pid in pids:
        process = psutil.Process(pid)
        times = process.cpu_times()
        total += times.user + times.system + times.children_user + times.children_system
        for child in process.children(recursive=True):
            total += sum(child.cpu_times()[:2])
    return total


def measure(
    services: list[RunningService], server_pid: int | None, kind: Kind, requests: int
) -> Measured:
    """So many requests, spread over the APIs, once they know such requests."""
    ports = [service.settings.port for service in services]
    apis = [service.process.pid for service in services]
    server = [] if server_pid is None else [server_pid]
    asyncio.run(ask(ports, kind, 50))
    api_s, server_s, begun_s = cpu_s(apis), cpu_s(server), time.monotonic()
    asyncio.run(ask(ports, kind, requests))
    took_s = time.monotonic() - begun_s
    return Measured(
        per_s=requests / took_s,
        api_ms=1000 * (cpu_s(apis) - api_s) / requests,
        server_ms=1000 * (cpu_s(server) - server_s) / requests,
    )


def main() -> None:
    """Measure in rounds, and print a table, or JSON."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--requests", type=int, default=1000, help="of each kind and round")
    asked.add_argument("--rounds", type=int, default=5)
    asked.add_argument("--json", action="store_true")
    wanted = asked.parse_args()
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="surefoot-rivals-")))
        server = Server(durable=True)
        server.start()
        stack.callback(server.remove)
        sqlite = stack.enter_context(api_over(folder / "sqlite", None))
        first = stack.enter_context(api_over(folder / "first", server.url()))
        second = stack.enter_context(api_over(folder / "second", server.url()))
        for service in (sqlite, first):
            register_cameras(service)
        arrangements = {
            _SQLITE: ([sqlite], None),
            _ONE: ([first], server.pid),
            _TWO: ([first, second], server.pid),
        }
        rounds = [
            {
                (kind.name, name): measure(services, pid, kind, wanted.requests)
                for kind in _KINDS
                for name, (services, pid) in arrangements.items()
            }
            for _ in range(wanted.rounds)
        ]
    found = {
        key: Measured(*map(median, zip(*(each[key] for each in rounds), strict=True)))
        for key in rounds[0]
    }
    table = Table("request", "on", "a second", "of SQLite's", "CPU ms, API", "CPU ms, server")
    told = []
    for (kind, name), each in found.items():
        ratio = median(one[kind, name].per_s / one[kind, _SQLITE].per_s for one in rounds)
        told.append({"request": kind, "on": name, "per_s": each.per_s, "ratio": ratio})
        server_ms = "" if name == _SQLITE else f"{each.server_ms:.2f}"
        row = (f"{each.per_s:,.0f}", f"{ratio:.2f}", f"{each.api_ms:.2f}", server_ms)
        table.add_row(kind, name, *row)
    if wanted.json:
        json.dump(told, sys.stdout, indent=1)
        return
    Console().print(table)


if __name__ == "__main__":
    main()
