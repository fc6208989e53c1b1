"""Who asks a city's service: trackers, readers of poses, pages, and one who follows events."""

import asyncio
import json
import random
import time
from collections import Counter, defaultdict
from typing import Any

import httpx

from tests.benchmarks.city.seeding import camera_id
from tests.benchmarks.parts.http_client import Connection
from tests.conftest import track

_CONNECTIONS = 48
_READS_HZ, _PAGES_HZ = 10.0, 0.1


class People:
    """They ask at their times; what comes too late is told by how long it took since then."""

    def __init__(self, ports: list[int], cameras: int, batch: int, apart_s: float) -> None:
        self._ports, self._cameras, self._batch = ports, cameras, batch
        self._random = random.Random(0)
        self._walk = track("0", start_s=0.0)["points"]
        self._every_s = apart_s * batch / cameras  # from one post of anybody to the next
        self.answers: Counter[str] = Counter()
        self.seconds: dict[str, list[float]] = defaultdict(list)
        self.events: Counter[str] = Counter()
        self._posted = 0

    async def run(self, lasts_s: float) -> None:
        """Ask for so long."""
        begun_s = time.monotonic()
        until = begun_s + lasts_s
        async with asyncio.TaskGroup() as group:
            for number in range(_CONNECTIONS):
                group.create_task(self._post(number, begun_s, until))
            for kind, often_hz in (("reads", _READS_HZ), ("pages", _PAGES_HZ)):
                group.create_task(self._read(kind, often_hz, until))
            group.create_task(self._follow(until))

    async def _post(self, number: int, begun_s: float, until: float) -> None:
        connection = Connection("127.0.0.1", self._ports[number % len(self._ports)])
        while time.monotonic() < until:
            turn, self._posted = self._posted, self._posted + 1
            due = begun_s + turn * self._every_s
            if due >= until:
                break
            await asyncio.sleep(max(0.0, due - time.monotonic()))
            path = f"/cameras/{camera_id(turn % self._cameras)}/tracks"
            await self._ask("posts", connection, path, due, self._body(turn))
        connection.close()

    def _body(self, turn: int) -> bytes:
        """Some people, the last of whom has just gone."""
        now = time.time()
        tracks = []
        for n in range(self._batch):
            last_s = now - 1.5 * (self._batch - n)
            first = last_s - self._walk[-1][0]
            aside = self._random.uniform(-150, 150)
            points = [[first + t, u + aside, v] for t, u, v in self._walk]
            tracks.append({"id": f"{turn}-{n}", "points": points})
        return json.dumps({"source": "city", "tracks": tracks}).encode()

    async def _read(self, kind: str, often_hz: float, until: float) -> None:
        connection = Connection("127.0.0.1", self._ports[0])
        due = time.monotonic()
        while (due := due + self._random.expovariate(often_hz)) < until:
            await asyncio.sleep(max(0.0, due - time.monotonic()))
            camera = camera_id(self._random.randrange(self._cameras))
            path = f"/cameras/{camera}/pose"
            if kind == "pages":
                path = self._random.choice(("/", f"/ui/cameras/{camera}"))
            label = "fleet page" if path == "/" else kind
            await self._ask(label, connection, path, max(due, time.monotonic()))
        connection.close()

    async def _follow(self, until: float) -> None:
        """The events, as an operator's page follows them."""
        async with httpx.AsyncClient(timeout=60) as client:
            try:
                async with asyncio.timeout(max(0.0, until - time.monotonic())):
                    async with client.stream(
                        "GET", f"http://127.0.0.1:{self._ports[0]}/events"
                    ) as stream:
                        async for line in stream.aiter_lines():
                            if line.startswith("event:"):
                                self.events[line.removeprefix("event:").strip()] += 1
            except (TimeoutError, httpx.HTTPError) as error:
                self.events[f"ended: {type(error).__name__}"] += 1

    async def _ask(
        self, kind: str, connection: Connection, path: str, due: float, body: bytes = b""
    ) -> None:
        answer = await connection.ask("POST" if body else "GET", path, body)
        self.answers[f"{kind} {answer.status} {answer.problem}".strip()] += 1
        self.seconds[kind].append(time.monotonic() - due)


def ask_for(
    ports: list[int], cameras: int, batch: int, apart_s: float, lasts_s: float, out: Any
) -> None:
    """All of them, in a process of their own."""
    people = People(ports, cameras, batch, apart_s)
    asyncio.run(people.run(lasts_s))
    out.send((people.answers, dict(people.seconds), people.events))
