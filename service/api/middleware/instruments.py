"""Counts and durations of this process's own requests, by route and status."""

import time

from prometheus_client import CollectorRegistry, Counter, Histogram, disable_created_metrics
from prometheus_client.process_collector import ProcessCollector
from starlette.types import ASGIApp, Message, Receive, Scope, Send

_METHODS = frozenset(("GET", "HEAD", "POST", "PATCH", "PUT", "DELETE", "OPTIONS"))
_REFUSALS = frozenset((413, 429, 503, 507))
_BUCKETS = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0)
# A second series for each counter, which nobody asks for.
disable_created_metrics()  # type: ignore[no-untyped-call]


class Instruments:
    """The process's own metrics; one for each application, so that two do not share counts."""

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        ProcessCollector(registry=self.registry)
        self.requests = Counter(
            "surefoot_http_requests",
            "Requests that were answered.",
            ["method", "route", "status"],
            registry=self.registry,
        )
        self.durations = Histogram(
            "surefoot_http_request_duration_seconds",
            "From a request to the beginning of its answer: event streams have no end.",
            ["method", "route"],
            buckets=_BUCKETS,
            registry=self.registry,
        )
        self.refusals = Counter(
            "surefoot_http_refusals",
            "Requests that were refused for a limit, the load or the store, by the problem's code.",
            ["code"],
            registry=self.registry,
        )
        self.connections_refused = Counter(
            "surefoot_http_connections_refused",
            "Connections that were not taken, or were cut, by the reason.",
            ["reason"],
            registry=self.registry,
        )


class InstrumentMiddleware:
    """Counts each answer under the template of its route, so that ids make no series."""

    def __init__(self, app: ASGIApp, instruments: Instruments) -> None:
        self._app = app
        self._instruments = instruments

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, and note how its answer begins."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        start_s = time.perf_counter()

        async def noting(message: Message) -> None:
            if message["type"] == "http.response.start":
                self._note(scope, message["status"], time.perf_counter() - start_s)
            await send(message)

        await self._app(scope, receive, noting)

    def _note(self, scope: Scope, status: int, duration_s: float) -> None:
        # What strangers may write, methods and paths, must not become labels.
        method = scope["method"] if scope["method"] in _METHODS else "other"
        route = getattr(scope.get("route"), "path", "unmatched")
        self._instruments.requests.labels(method, route, str(status)).inc()
        self._instruments.durations.labels(method, route).observe(duration_s)
        if status in _REFUSALS and "surefoot_problem" in scope:
            self._instruments.refusals.labels(scope["surefoot_problem"]).inc()
