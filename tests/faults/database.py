"""The PostgreSQL server of a run, and a link to it for each machine, which can be cut."""

import asyncio
import threading
from collections.abc import Coroutine
from contextlib import suppress
from pathlib import Path
from typing import Any

import psycopg

from tests.stores.server import Server

_SOCKET = ".s.PGSQL.5432"
_AT_ONCE = 2**16


class Link:
    """A socket that leads to the server; while it is cut, nothing comes through either way.

    As on a network, connections are not closed by that, and what was sent arrives once it is
    mended.
    """

    def __init__(self, folder: Path, server: Server, loop: asyncio.AbstractEventLoop) -> None:
        folder.mkdir()
        self.url = f"postgresql://postgres@/postgres?host={folder}"
        self._here, self._there, self._loop = folder / _SOCKET, server.folder / _SOCKET, loop
        self._open, self._passing = asyncio.Event(), set[asyncio.Task[None]]()
        self._open.set()
        self._await(self._listen())

    def cut(self) -> None:
        """Let nothing through from now on."""
        self._loop.call_soon_threadsafe(self._open.clear)

    def mend(self) -> None:
        """Let through what comes, and what has come meanwhile."""
        self._loop.call_soon_threadsafe(self._open.set)

    def _await(self, what: Coroutine[Any, Any, None]) -> None:
        asyncio.run_coroutine_threadsafe(what, self._loop).result(10)

    async def _listen(self) -> None:
        await asyncio.start_unix_server(self._accept, self._here)

    async def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await self._open.wait()
        try:
            there = await asyncio.open_unix_connection(self._there)
        except OSError:  # the server is down: whoever asks is hung up on
            writer.close()
            return
        for begin, end in ((reader, there[1]), (there[0], writer)):
            task = asyncio.create_task(self._pass(begin, end))
            self._passing.add(task)
            task.add_done_callback(self._passing.discard)

    async def _pass(self, begin: asyncio.StreamReader, end: asyncio.StreamWriter) -> None:
        with suppress(OSError):
            while part := await begin.read(_AT_ONCE):
                await self._open.wait()
                end.write(part)
                await end.drain()
        with suppress(OSError):
            end.close()


class Database:
    """A server that makes sure of each commit, and the links (machines,) to it."""

    def __init__(self, folder: Path, machines: int) -> None:
        self._server = Server(durable=True)
        self._server.start()
        self.url = self._server.url()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()
        self.links = [
            Link(folder / f"link-{number}", self._server, self._loop) for number in range(machines)
        ]

    def restart(self) -> None:
        """End it at once, as a crash does, and start it again: it recovers from its log."""
        self._server.stop("immediate")
        self._server.start()

    def read_only(self, on: bool) -> None:
        """Have it refuse all that writes, as one does that has become a standby."""
        words = "on" if on else "off"
        writing = "-c default_transaction_read_only=off"
        with psycopg.connect(self.url, autocommit=True, options=writing) as connection:
            connection.execute(f"ALTER SYSTEM SET default_transaction_read_only = {words}")
            connection.execute("SELECT pg_reload_conf()")

    def close(self) -> None:
        """End it, and throw it away."""
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._server.remove()
