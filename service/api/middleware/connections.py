"""Connections: so many, so many from an address, and none that only keeps its place.

Where tokens are needed, who has shown none gives way to who comes, the oldest first: a place is
kept by a token. Elsewhere a request keeps it. After them who asks nothing just then gives way, the
longest silent first: a client may close, and be closed, between its requests.

uvicorn waits for ever for headers, for bodies and for clients that take their answers.
"""

import asyncio
import json
import math
import resource
from collections import Counter
from http import HTTPStatus
from typing import Any

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

from service.api.middleware.hosts import auth_on
from service.api.middleware.instruments import Instruments
from service.settings import Settings

_OTHER_FILES = 256  # the database, logs, pipes, and what is accepted in one go before it is counted
_LEAST_BODY_BYTES = 1024  # a second
# Of a body that was refused so much is read and thrown away: a client that is cut while it sends
# does not see the answer.
_LINGER_S = 15.0
_MOST_UNREAD_BYTES = 8 * 1024 * 1024  # of who has shown no token


def _refusal(status: HTTPStatus, code: str, detail: str) -> bytes:
    """A problem document as it goes over the wire, where no application is asked."""
    title = status.phrase
    problem = {"type": "about:blank", "title": title, "status": status, "code": code}
    body = json.dumps({**problem, "detail": detail}, separators=(",", ":"))
    return (
        f"HTTP/1.1 {status} {title}\r\ncontent-type: application/problem+json\r\n"
        f"x-content-type-options: nosniff\r\ncontent-length: {len(body)}\r\n"
        f"retry-after: 2\r\nconnection: close\r\n\r\n{body}"
    ).encode()


_BUSY = _refusal(
    HTTPStatus.SERVICE_UNAVAILABLE, "overloaded", "connections: as many are open as may be"
)
_LATE = _refusal(HTTPStatus.REQUEST_TIMEOUT, "request_timeout", "the request did not come in time")


class ConnectionGuard:
    """Shared state of a server's connections: their number, and whose they are."""

    def __init__(self, settings: Settings, instruments: Instruments) -> None:
        soft = allow_descriptors()
        self.most = max(1, min(settings.max_connections, soft - _OTHER_FILES))
        self.most_of_address = settings.connections_per_address or math.inf
        self.head_timeout_s = settings.head_timeout_s
        self.stall_timeout_s = settings.stall_timeout_s
        self.refused = instruments.connections_refused
        self.of_address: Counter[str] = Counter()
        self.open = 0
        self.auth = auth_on(settings)
        self.strangers: dict[GuardedProtocol, None] = {}  # who may have to give way; oldest first
        self.idle: dict[GuardedProtocol, None] = {}  # between requests; the longest so first


def allow_descriptors() -> int:
    """The most file descriptors of this process, raised to all that it can get."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft != hard:
        resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    return hard if hard != resource.RLIM_INFINITY else 1_000_000


class GuardedProtocol(H11Protocol):
    """A connection whose headers, body and reader must keep moving."""

    def __init__(self, *args: Any, guard: ConnectionGuard, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._guard = guard
        self._counted = False
        self._address = ""
        self._received = 0  # since the timer was set
        self._unread = 0  # of the body of a request that is answered already
        self._answered_s = 0.0
        self._awaiting: Any = None  # h11's state of the client that the timer is for
        self._timer: asyncio.TimerHandle | None = None
        self._reader_timer: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Take a connection, or refuse it at once."""
        super().connection_made(transport)
        guard = self._guard
        self._address = self.client[0] if self.client else "local"
        many = guard.of_address[self._address] >= guard.most_of_address
        if many and not self._made_room("address", {self._address}):
            return
        if guard.open >= guard.most and not self._made_room("full", set(guard.of_address)):
            return
        self._counted = True
        guard.open += 1
        guard.of_address[self._address] += 1
        guard.strangers[self] = None
        self._watch()

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget the connection."""
        self._leave()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Take what came, and see what must come next."""
        if self.transport.is_closing():
            return
        self._received += len(data)
        self._guard.idle.pop(self, None)
        super().data_received(data)
        if self._answered_early():
            self._unread += len(data)
            if self._unread > _MOST_UNREAD_BYTES and not self._known():
                self._count("unread")
                self.transport.abort()
                return
        self._watch()

    def on_response_complete(self) -> None:
        """Wait for the next request."""
        super().on_response_complete()
        self._unread = 0
        self._answered_s = self.loop.time()
        if self._counted and self.conn.their_state is h11.IDLE:
            self._guard.idle[self] = None
        self._watch()

    def pause_writing(self) -> None:
        """Give a client that does not take its answer some time."""
        super().pause_writing()
        if self._reader_timer is None:
            self._watch_reader()

    def resume_writing(self) -> None:
        """It takes its answer."""
        super().resume_writing()
        if self._reader_timer is not None:
            self._reader_timer.cancel()
            self._reader_timer = None

    def _known(self) -> bool:
        """True once a request was let in by a token, or has come where none is needed.

        uvicorn makes the scope of each request; the guard notes in it who asks.
        """
        if self.scope is None:
            return False
        return not self._guard.auth or self.scope["state"].get("caller") is not None

    def _made_room(self, reason: str, addresses: set[str]) -> bool:
        """End the oldest of those who have to give way, else the longest idle, else this one."""
        for oldest in [other for other in self._guard.strangers if other._address in addresses]:
            if oldest._known():
                del self._guard.strangers[oldest]
                continue
            if oldest.scope is None:
                oldest._end("silent", _LATE, abort=True)
            else:
                oldest._end("stranger", _BUSY, abort=True)
            return True
        for idle in self._guard.idle:
            if idle._address in addresses:
                idle._end("idle", b"")  # who has asked nothing is answered nothing
                return True
        self._end(reason, _BUSY)
        return False

    def _answered_early(self) -> bool:
        """True while there is more to come of a body that is answered already."""
        return self.conn.our_state is h11.DONE and self.conn.their_state is h11.SEND_BODY

    def _watch(self) -> None:
        """Set the timer for what the client must send next; a drip does not set it anew."""
        awaited = self.conn.their_state
        if awaited is self._awaiting and self._timer is not None:
            return
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self._awaiting = awaited
        if self.transport.is_closing():
            return
        if awaited is h11.IDLE:
            # Between requests uvicorn's own timer runs until something comes.
            if self.timeout_keep_alive_task is None:
                self._timer = self.loop.call_later(self._guard.head_timeout_s, self._head_late)
        elif awaited is h11.SEND_BODY:
            self._received = 0
            self._timer = self.loop.call_later(self._guard.stall_timeout_s, self._body_late)

    def _head_late(self) -> None:
        self._timer = None
        self._end("head", _LATE)

    def _body_late(self) -> None:
        self._timer = None
        least = _LEAST_BODY_BYTES * self._guard.stall_timeout_s
        lingers = self._answered_early() and self.loop.time() - self._answered_s >= _LINGER_S
        if not lingers and (self.flow.read_paused or self._received >= least):
            self._watch()
            return
        self._end("body", _LATE)

    def _watch_reader(self) -> None:
        left = self.transport.get_write_buffer_size()
        self._reader_timer = self.loop.call_later(
            self._guard.stall_timeout_s, self._reader_late, left
        )

    def _reader_late(self, left: int) -> None:
        if self.transport.get_write_buffer_size() < left:  # slow, but it takes something
            self._watch_reader()
            return
        self._reader_timer = None
        self._count("reader")
        self.transport.abort()

    def _end(self, reason: str, answer: bytes, abort: bool = False) -> None:
        """Answer as well as it goes, and close."""
        self._count(reason)
        self._leave()
        if self.transport.is_closing():
            return
        cycle = self.cycle
        if cycle is None or not cycle.response_started or self.conn.our_state is h11.IDLE:
            self.transport.write(answer)
        if abort:
            self.transport.abort()
        else:
            self.transport.close()

    def _leave(self) -> None:
        guard = self._guard
        guard.strangers.pop(self, None)
        guard.idle.pop(self, None)
        for timer in (self._timer, self._reader_timer):
            if timer is not None:
                timer.cancel()
        self._timer = self._reader_timer = None
        if self._counted:
            self._counted = False
            guard.open -= 1
            guard.of_address[self._address] -= 1
            if not guard.of_address[self._address]:
                del guard.of_address[self._address]

    def _count(self, reason: str) -> None:
        self._guard.refused.labels(reason).inc()
