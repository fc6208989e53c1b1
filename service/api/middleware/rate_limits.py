"""Rate limits of a token, or an address without one, and of posts about a camera."""

import re
import time
from collections import OrderedDict

from starlette.types import ASGIApp, Receive, Scope, Send

from service.errors import TooManyRequestsError
from service.settings import Settings

_MOST_KEYS = 10_000
_BURST_S = 5.0  # of silence that may be made up for at once
_CAMERA = re.compile(r"/cameras/([^/]+)/tracks")
_FREE = ("/healthz", "/readyz")


class Buckets:
    """Token buckets by key: `rate_hz` in the long run, five seconds' worth at once."""

    def __init__(self, what: str, rate_hz: float) -> None:
        self._what = what
        self._rate_hz = rate_hz
        self._most = max(rate_hz * _BURST_S, 1.0)
        self._levels: OrderedDict[str, tuple[float, float]] = OrderedDict()  # level, when

    def take(self, key: str) -> None:
        """Take one.

        Raises:
            TooManyRequestsError: none is there; with the time until there is.
        """
        if not self._rate_hz:
            return
        now = time.monotonic()
        level, then = self._levels.pop(key, (self._most, now))
        level = min(self._most, level + (now - then) * self._rate_hz)
        # One key more than may be kept forgets the one that was quiet longest: it is full again.
        self._levels[key] = (level - 1 if level >= 1 else level, now)
        if len(self._levels) > _MOST_KEYS:
            self._levels.popitem(last=False)
        if level < 1:
            raise TooManyRequestsError(
                f"{self._what}: {self._rate_hz:g} requests a second are allowed for {key:.80}",
                retry_after_s=(1 - level) / self._rate_hz,
            )


class RateMiddleware:
    """Refuses who asks too often, before anything is read."""

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self._app = app
        self._callers = Buckets("rate", settings.caller_rate)
        self._cameras = Buckets("camera", settings.camera_rate)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on.

        Raises:
            TooManyRequestsError: its caller asks too often, or its camera is told of too often.
        """
        if scope["type"] == "http" and scope["path"] not in _FREE:
            self._callers.take(caller_key(scope))
            camera = _CAMERA.fullmatch(scope["path"])
            if camera and scope["method"] == "POST":
                self._cameras.take(camera[1])
        await self._app(scope, receive, send)


def caller_key(scope: Scope) -> str:
    """The name that limits count a caller by: its token, or its address without one."""
    state = scope.get("state", {})
    if state.get("token_id") is not None:
        return f"token {state['token_id']}"
    # The guard knows what a proxy of ours says of where somebody is.
    return f"address {state.get('address') or (scope.get('client') or ('unknown',))[0]}"
