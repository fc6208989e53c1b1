"""Admission of requests: a body is read whole, then it waits for its turn; so many at once.

Kinds of requests have lanes of their own, so that none starves another; `/healthz` needs none.
Who has shown no token where one is needed can only log in: in a lane of its own, by a small body.
"""

import asyncio
import contextlib
import math
import re
import threading
from collections import Counter
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from functools import partial

import anyio
import anyio.to_thread
from anyio._backends import _asyncio
from starlette.requests import ClientDisconnect
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.api.middleware.hosts import auth_on
from service.api.middleware.rate_limits import caller_key
from service.errors import OverloadedError, TooLargeError, TooManyRequestsError
from service.settings import Settings

_COME_BACK_S = 2.0
_OPERATION_AT_ONCE = 2
_STRANGERS_AT_ONCE = 4
_STRANGERS_MB = 1 / 64  # of a body: a token is some hundred bytes
_IMAGES_AT_ONCE = 2  # one is decoded, one waits for its turn
_AIMS_AT_ONCE = 8  # most of their time they wait for a camera
_STREAMS_OF_A_CALLER = 4  # a caller opens at most one in so many of `max_streams`
STREAM_POLLS = 2  # of all event streams together
LOOKUPS = 4  # of who asks, before a request has its turn
_THREADS_START_S = 30.0  # at the longest


class Lane:
    """Turns for requests of one kind, in the order of their coming; in one event loop."""

    def __init__(self, name: str, *, at_once: int, waiting: int, patience_s: float) -> None:
        self._name = name
        self._free = asyncio.Semaphore(at_once)
        self._most_waiting = waiting
        self._patience_s = patience_s
        self._waiting = 0

    def check(self) -> None:
        """Refuse before anything is read.

        Raises:
            OverloadedError: as many wait already as may.
        """
        if self._free.locked() and self._waiting >= self._most_waiting:
            raise OverloadedError(
                f"{self._name}: every place is taken, and {self._most_waiting} requests wait",
                retry_after_s=_COME_BACK_S,
            )

    @asynccontextmanager
    async def turn(self) -> AsyncIterator[None]:
        """Wait for a turn, and have it as long as the block lasts.

        Raises:
            OverloadedError: too many wait already, or the turn did not come in time.
        """
        self.check()
        self._waiting += 1
        try:
            async with asyncio.timeout(self._patience_s):
                await self._free.acquire()
        except TimeoutError as error:
            raise OverloadedError(
                f"{self._name}: no turn came within {self._patience_s:g} s",
                retry_after_s=_COME_BACK_S,
            ) from error
        finally:
            self._waiting -= 1
        try:
            yield
        finally:
            self._free.release()


class Shares:
    """Requests of one kind by caller or by camera, so that none of these takes all places."""

    def __init__(self, name: str, most: int) -> None:
        self._name = name
        self._most = most
        self._held: Counter[str] = Counter()

    @contextmanager
    def place(self, holder: str) -> Iterator[None]:
        """Hold a place as long as the block lasts.

        Raises:
            TooManyRequestsError: the caller or camera holds its share already.
        """
        if self._held[holder] >= self._most:
            raise TooManyRequestsError(
                f"{self._name}: at most {self._most} at once for {holder:.80}",
                retry_after_s=_COME_BACK_S,
            )
        self._held[holder] += 1
        try:
            yield
        finally:
            self._held[holder] -= 1
            if not self._held[holder]:
                del self._held[holder]


class Lanes:
    """The lanes of an application."""

    def __init__(self, settings: Settings) -> None:
        def lane(name: str, at_once: int, waiting: int) -> Lane:
            return Lane(name, at_once=at_once, waiting=waiting, patience_s=settings.http_wait_s)

        self._reads = lane("reads", settings.http_at_once, settings.http_waiting)
        self._writes = lane("writes", settings.http_at_once, settings.http_waiting)
        self._operation = lane("operation", _OPERATION_AT_ONCE, settings.http_waiting)
        self._strangers = lane("logins", _STRANGERS_AT_ONCE, settings.http_waiting)
        self._images = lane("images", _IMAGES_AT_ONCE, settings.http_waiting)
        self._aims = lane("aims", _AIMS_AT_ONCE, settings.http_waiting)
        self._streams = lane("streams", settings.max_streams, 0)

    def of(self, scope: Scope, *, stranger: bool) -> Lane | None:
        """The lane of a request; None for what is answered whatever the load."""
        path = scope["path"]
        if path == "/healthz":
            return None
        if path in ("/readyz", "/metrics"):
            return self._operation
        if stranger:
            return self._strangers
        if path == "/events":
            return self._streams
        # Both may take seconds: a camera that is asked for its image, or an image that is decoded.
        if _AIM.fullmatch(path):
            return self._aims
        if scope["method"] == "PUT" and _IMAGE.fullmatch(path):
            return self._images
        return self._reads if scope["method"] in ("GET", "HEAD") else self._writes


def sessions_at_once(settings: Settings) -> int:
    """The most sessions that requests have at once: a request has one at a time."""
    in_lanes = 2 * settings.http_at_once + _OPERATION_AT_ONCE + _STRANGERS_AT_ONCE
    return in_lanes + _IMAGES_AT_ONCE + _AIMS_AT_ONCE + STREAM_POLLS + LOOKUPS


async def start_threads(number: int) -> None:
    """Start as many threads as may answer at once, in this event loop; they end with it.

    The loop waits for a thread that it starts to run, up to 16 ms where 64 clients keep two cores
    busy, and nobody is answered meanwhile: so all are made before the first request, and kept.
    """
    # anyio ends what has been idle for 10 s, and has no setting for it.
    _asyncio.WorkerThread.MAX_IDLE_TIME = math.inf  # type: ignore[assignment]
    anyio.to_thread.current_default_thread_limiter().total_tokens = number
    together = threading.Barrier(number)  # a thread that waits is not given to the next
    async with anyio.create_task_group() as group:
        for _ in range(number):
            group.start_soon(partial(anyio.to_thread.run_sync, together.wait, _THREADS_START_S))


_MB = 1024 * 1024
_TRACKS = re.compile(r"(/cameras/[^/]+/tracks|/ui/tracks)")
_AIM = re.compile(r"/cameras/([^/]+)/aim")
_IMAGE = re.compile(r"/cameras/[^/]+/(snapshot|aim|plan)")


class AdmissionMiddleware:
    """Counts bytes as they come, and hands a body on when all of it is there and its turn comes.

    Slow senders therefore hold nothing but their own bytes. A request for whose kind there is no
    room is refused before its body is read.
    """

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self._app = app
        self._settings = settings
        self._lanes = Lanes(settings)
        most = max(settings.max_streams // _STREAMS_OF_A_CALLER, 1)
        self._streams = Shares("streams", most)
        self._aims = Shares("aims", 1)
        self._auth = auth_on(settings)
        self._held = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on with its body, when its turn comes.

        Raises:
            TooLargeError: the body is, or says it is, larger than its kind may be.
            OverloadedError: there is no room for it now, or no turn came in time.
        """
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        stranger = self._auth and scope.get("state", {}).get("caller") is None
        lane = self._lanes.of(scope, stranger=stranger)
        if lane is not None:
            lane.check()
        headers = {name: value for name, value in scope["headers"] if name in _LENGTHS}
        if not headers:
            await self._admit(lane, scope, receive, send)
            return
        limit = round((_STRANGERS_MB if stranger else self._limit_mb(scope["path"])) * _MB)
        declared = headers.get(b"content-length", b"0")
        if declared.isdigit() and int(declared) > limit:
            raise _too_large(limit, f"{int(declared)}")
        body: list[bytes] = []
        held = 0
        try:
            more = True
            while more:
                message = await receive()
                if message["type"] != "http.request":
                    raise ClientDisconnect
                chunk, more = message.get("body", b""), message.get("more_body", False)
                held += len(chunk)
                self._held += len(chunk)
                if held > limit:
                    raise _too_large(limit, f"at least {held}")
                if self._held > self._settings.max_bodies_mb * _MB:
                    raise OverloadedError(
                        f"body: {self._settings.max_bodies_mb:g} MiB of other bodies are here",
                        retry_after_s=2,
                    )
                body.append(chunk)
            await self._admit(lane, scope, _replay(body, receive), send)
        finally:
            self._held -= held

    async def _admit(self, lane: Lane | None, scope: Scope, receive: Receive, send: Send) -> None:
        with contextlib.ExitStack() as share:
            if scope["path"] == "/events":
                share.enter_context(self._streams.place(caller_key(scope)))
            elif aim := _AIM.fullmatch(scope["path"]):
                share.enter_context(self._aims.place(f"camera {aim[1]}"))
            async with contextlib.nullcontext() if lane is None else lane.turn():
                await self._app(scope, receive, send)

    def _limit_mb(self, path: str) -> float:
        if _TRACKS.fullmatch(path):
            return self._settings.max_tracks_body_mb
        if _IMAGE.fullmatch(path):
            return self._settings.max_snapshot_mb
        return self._settings.max_body_mb


_LENGTHS = (b"content-length", b"transfer-encoding")


def _too_large(limit: int, got: str) -> TooLargeError:
    return TooLargeError(f"body: at most {limit} bytes are taken here, got {got}")


def _replay(body: list[bytes], receive: Receive) -> Receive:
    """The body that was read, then whatever else comes: that the client is gone."""
    body.reverse()

    async def replayed() -> Message:
        if not body:
            return await receive()
        chunk = body.pop()
        return {"type": "http.request", "body": chunk, "more_body": bool(body)}

    return replayed
