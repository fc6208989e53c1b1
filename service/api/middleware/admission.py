"""Admission of requests: a body is read whole, then it waits for its turn; so many at once."""

import contextlib
import re

from starlette.requests import ClientDisconnect
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.api.middleware.concurrency import Lane, Lanes
from service.errors import OverloadedError, TooLargeError
from service.settings import Settings

_MB = 1024 * 1024
_TRACKS = re.compile(r"/cameras/[^/]+/tracks|/ui/tracks")
_SNAPSHOT = re.compile(r"/cameras/[^/]+/snapshot")


class AdmissionMiddleware:
    """Counts bytes as they come, and hands a body on when all of it is there and its turn comes.

    Slow senders therefore hold nothing but their own bytes. A request for whose kind there is no
    room is refused before its body is read.
    """

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self._app = app
        self._settings = settings
        self._lanes = Lanes(settings)
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
        lane = self._lanes.of(scope)
        if lane is not None:
            lane.check()
        headers = {name: value for name, value in scope["headers"] if name in _LENGTHS}
        if not headers:
            await self._admit(lane, scope, receive, send)
            return
        limit = round(self._limit_mb(scope["path"]) * _MB)
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
        async with contextlib.nullcontext() if lane is None else lane.turn():
            await self._app(scope, receive, send)

    def _limit_mb(self, path: str) -> float:
        if _TRACKS.fullmatch(path):
            return self._settings.max_tracks_body_mb
        if _SNAPSHOT.fullmatch(path):
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
