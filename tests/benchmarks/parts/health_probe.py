"""How long /healthz takes, beside a server on the same machine that has nothing to do."""

import asyncio
import contextlib
import gc
import multiprocessing
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection as Pipe
from multiprocessing.synchronize import Event

from tests.benchmarks.parts.http_client import Connection
from tests.running import free_port


def _answer_at_once(port: int) -> None:
    """A server that has nothing else to do: what it takes is the machine's doing."""

    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(asyncio.IncompleteReadError):
            while await reader.readuntil(b"\r\n\r\n"):
                writer.write(b"HTTP/1.1 200 OK\r\ncontent-length: 0\r\n\r\n")

    async def serve() -> None:
        await (await asyncio.start_server(answer, "127.0.0.1", port)).serve_forever()

    asyncio.run(serve())


@dataclass(frozen=True, slots=True)
class Probe:
    """When it was, and how long /healthz took, and the server that has nothing to do just after."""

    at_s: float
    health_s: float
    idle_s: float


@contextlib.contextmanager
def probing(port: int, every_s: float = 0.1) -> Iterator[Callable[[], list[Probe]]]:
    """Ask for /healthz within the block, from a process of its own that has begun by then.

    What is given ends it, and returns all that it has seen.
    """
    context = multiprocessing.get_context("spawn")
    stop, begun, (mine, theirs) = context.Event(), context.Event(), context.Pipe()
    idle_port = free_port()
    idle = context.Process(target=_answer_at_once, args=(idle_port,), daemon=True)
    asked = (port, idle_port, every_s, begun, stop, theirs)
    prober = context.Process(target=_probe_health, args=asked, daemon=True)
    idle.start()
    prober.start()
    begun.wait()

    def ended() -> list[Probe]:
        stop.set()
        seen: list[Probe] = mine.recv()
        prober.join()
        return seen

    try:
        yield ended
    finally:
        prober.terminate()
        idle.terminate()


def _probe_health(
    port: int, idle_port: int, every_s: float, begun: Event, stop: Event, pipe: Pipe
) -> None:
    # Else it looks once through all that it has imported, and that would be the server's delay.
    gc.freeze()

    async def seconds(connection: Connection) -> float:
        begun = time.perf_counter()
        answer = await connection.ask("GET", "/healthz")
        return time.perf_counter() - begun if answer.status == 200 else 60.0

    async def probe() -> list[Probe]:
        taken, health = [], Connection("127.0.0.1", port)
        idle = Connection("127.0.0.1", idle_port)
        while (await idle.ask("GET", "/")).status != 200:  # it is being started
            await asyncio.sleep(0.05)
        first = time.perf_counter()
        begun.set()
        while not stop.is_set():
            at_s = time.perf_counter() - first
            taken.append(Probe(at_s, await seconds(health), await seconds(idle)))
            await asyncio.sleep(every_s)
        return taken

    pipe.send(asyncio.run(probe()))
