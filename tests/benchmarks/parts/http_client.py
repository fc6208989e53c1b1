"""A small HTTP client for load: one connection, one request at a time, nothing kept."""

import asyncio
import json
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """How a request was answered; `status` 0: not at all."""

    status: int
    retry_after: bool
    problem: str


class Connection:
    """A connection that is opened when it is needed."""

    def __init__(self, host: str, port: int) -> None:
        self._address = (host, port)
        self._reader: asyncio.StreamReader | None = None
        self._writer: asyncio.StreamWriter | None = None

    async def ask(self, method: str, path: str, body: bytes = b"") -> Answer:
        """The answer to a request; one that met a kept connection's end is sent once more."""
        kept = self._writer is not None
        try:
            async with asyncio.timeout(60):
                try:
                    return await self._ask(method, path, body)
                except (ConnectionError, asyncio.IncompleteReadError) as error:
                    if not kept or getattr(error, "partial", b""):
                        raise
                    self.close()
                    return await self._ask(method, path, body)
        except (OSError, EOFError, TimeoutError, ValueError) as error:
            self.close()
            return Answer(status=0, retry_after=False, problem=type(error).__name__)

    async def _ask(self, method: str, path: str, body: bytes) -> Answer:
        if self._writer is None or self._writer.is_closing():
            self._reader, self._writer = await asyncio.open_connection(*self._address)
        assert self._reader is not None
        head = (
            f"{method} {path} HTTP/1.1\r\nHost: {self._address[0]}\r\n"
            f"Content-Type: application/json\r\nContent-Length: {len(body)}\r\n\r\n"
        )
        self._writer.write(head.encode() + body)
        lines = (await self._reader.readuntil(b"\r\n\r\n")).decode("latin-1").split("\r\n")
        headers = dict(line.lower().split(": ", 1) for line in lines[1:] if line)
        content = await self._reader.readexactly(int(headers.get("content-length", "0")))
        if headers.get("connection") == "close":
            self.close()
        problem = headers.get("content-type", "") == "application/problem+json"
        return Answer(
            status=int(lines[0].split()[1]),
            retry_after="retry-after" in headers,
            problem=json.loads(content)["code"] if problem else "",
        )

    def close(self) -> None:
        """Let go of it."""
        if self._writer is not None:
            self._writer.close()
        self._writer = None
