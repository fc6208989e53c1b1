"""What requests cost the server, in CPU: `python -m tests.benchmarks.requests`.

By one client that waits for each answer, and by sixteen. Beside it, in the same run, what a FastAPI
that only says a word costs: the least that any answer can.
"""

import argparse
import asyncio
import json
import multiprocessing
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import count
from pathlib import Path

import psutil
import uvicorn
from fastapi import FastAPI
from rich.console import Console
from rich.table import Table

from service.commands.migrate import migrate
from service.settings import Settings
from tests.benchmarks.parts.http_client import Connection
from tests.conftest import CAMERA, track
from tests.running import RunningService, free_port, wait_for

CLIENTS = 16
_BATCH = 50
_CAMERAS = 8

Bodies = Iterator[tuple[str, bytes]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Kind:
    """A request, a POST where it has a body; `aim_ms` is what issue 16 would have it cost."""

    name: str
    clients: int
    asks: Callable[[], Bodies]
    aim_ms: float | None = None


def bare(port: int) -> None:
    """A service that only says a word."""
    app = FastAPI(openapi_url=None)

    @app.get("/word")
    async def word() -> dict[str, str]:
        return {"status": "ok"}

    uvicorn.run(app, port=port, log_level="warning", access_log=False)


def gets(path: str) -> Callable[[], Bodies]:
    """The same for one camera after another."""
    return lambda: ((path.format(f"cost-{n % _CAMERAS}"), b"") for n in count())


def posts(tracks: int) -> Callable[[], Bodies]:
    """People who have not been posted before, 20 points each."""

    def asks() -> Bodies:
        for n in count():
            start_s = time.time() - 10
            some = [track(f"{start_s}-{n}-{each}", start_s) for each in range(tracks)]
            body = json.dumps({"source": "cost", "tracks": some}).encode()
            yield f"/cameras/cost-{n % _CAMERAS}/tracks", body

    return asks


KINDS = (
    Kind(name="/healthz", clients=1, asks=gets("/healthz")),
    Kind(name="a pose", clients=1, asks=gets("/cameras/{}/pose"), aim_ms=1 / 1.5),
    Kind(
        name=f"a pose, {CLIENTS} clients",
        clients=CLIENTS,
        asks=gets("/cameras/{}/pose"),
        aim_ms=1 / 1.5,
    ),
    Kind(name="a track", clients=1, asks=posts(1), aim_ms=1.0),
    Kind(
        name=f"a track, {CLIENTS} clients",
        clients=CLIENTS,
        asks=posts(1),
        aim_ms=1.0,
    ),
    Kind(name=f"{_BATCH} tracks", clients=1, asks=posts(_BATCH), aim_ms=_BATCH / 5),
)


@contextmanager
def api_over(folder: Path, database_url: str | None = None) -> Iterator[RunningService]:
    """An API without workers, with its data in a folder; the cameras are not registered yet.

    The clients are one address, and nobody looks at what they post: no rate is limited.
    """
    settings = Settings(
        data_dir=folder / "data",
        database_url=database_url,
        port=free_port(),
        workers=0,
        caller_rate=0,
        camera_rate=0,
    )
    folder.mkdir(exist_ok=True)
    migrate(settings)
    service = RunningService(settings, forked=False)
    service.start()
    try:
        yield service
    finally:
        service.stop()


def register_cameras(service: RunningService) -> None:
    """Those that the requests go to."""
    for number in range(_CAMERAS):
        body = {**CAMERA, "id": f"cost-{number}"}
        service.http.post("/cameras", json=body).raise_for_status()


async def ask(ports: Sequence[int], kind: Kind, requests: int) -> None:
    """So many requests, by so many clients, each of one of the services."""
    asks, left = kind.asks(), iter(range(requests))

    async def client(number: int) -> None:
        connection = Connection("127.0.0.1", ports[number % len(ports)])
        for _ in left:
            path, body = next(asks)
            answer = await connection.ask("POST" if body else "GET", path, body)
            assert answer.status in (200, 202), f"{path}: {answer}"
        connection.close()

    await asyncio.gather(*(client(number) for number in range(kind.clients)))


def cpu_ms(process: psutil.Process, port: int, kind: Kind, requests: int) -> float:
    """What one of so many requests costs a process, once it knows them."""
    asyncio.run(ask([port], kind, 50))
    before = sum(process.cpu_times()[:2])
    asyncio.run(ask([port], kind, requests))
    return 1000 * (sum(process.cpu_times()[:2]) - before) / requests


def main() -> None:
    """Measure each kind of request, and print a table, or JSON."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--requests", type=int, default=1000)
    asked.add_argument("--json", action="store_true")
    wanted = asked.parse_args()
    least = bare_ms(wanted.requests)
    with (
        tempfile.TemporaryDirectory(prefix="surefoot-requests-") as folder,
        api_over(Path(folder)) as service,
    ):
        register_cameras(service)
        process, port = psutil.Process(service.process.pid), service.settings.port
        found = {kind.name: cpu_ms(process, port, kind, wanted.requests) for kind in KINDS}
    if wanted.json:
        json.dump({"bare_fastapi_ms": least, "cpu_ms": found}, sys.stdout, indent=1)
        return
    table = Table("request", "CPU ms", "of a bare FastAPI's", "a CPU-second", "aim, ms")
    table.add_row("a bare FastAPI's word", f"{least:.2f}", "1", f"{1000 / least:,.0f}", "")
    for kind in KINDS:
        ms = found[kind.name]
        aim = "" if kind.aim_ms is None else f"{kind.aim_ms:.2f}"
        table.add_row(kind.name, f"{ms:.2f}", f"{ms / least:.1f}", f"{1000 / ms:,.0f}", aim)
    Console().print(table)


def bare_ms(requests: int) -> float:
    """What an answer costs that says only a word."""
    port = free_port()
    process = multiprocessing.get_context("spawn").Process(target=bare, args=(port,), daemon=True)
    process.start()
    kind = Kind(name="bare", clients=1, asks=lambda: (("/word", b"") for _ in count()))

    def answers() -> bool:
        async def once() -> int:
            return (await Connection("127.0.0.1", port).ask("GET", "/word")).status

        return asyncio.run(once()) == 200

    try:
        wait_for(answers, timeout_s=30)
        return cpu_ms(psutil.Process(process.pid), port, kind, requests)
    finally:
        process.terminate()
        process.join()


if __name__ == "__main__":
    main()
