"""Hosts that this service goes by, and origins of pages that may ask: its own alone.

Every page of the web can send requests from the browser of an operator, and any name can be made
to lead to this service. Programs send neither `Origin` nor `Sec-Fetch-Site` and pass.
"""

import socket
from ipaddress import ip_address
from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from service.errors import NotFoundError, ServiceError
from service.settings import Settings

_LOCAL = "localhost"
_SAFE = frozenset(("GET", "HEAD", "OPTIONS"))
_OURS = frozenset(("same-origin", "none"))
_PORTS = {"http": 80, "https": 443}


def is_loopback(host: str) -> bool:
    """True of a name or an address of this machine's own."""
    return host == _LOCAL or (_is_address(host) and ip_address(host).is_loopback)


def auth_on(settings: Settings) -> bool:
    """True where tokens are needed: by themselves wherever others than this machine may ask."""
    if settings.auth != "auto":
        return settings.auth == "on"
    here = is_loopback(settings.host) and is_loopback(_public_host(settings) or _LOCAL)
    return not here or bool(settings.proxy_from)


class MisdirectedError(ServiceError):
    """The request is for a host that this service is not."""

    status, code = 421, "misdirected"


class ForeignOriginError(ServiceError):
    """A page of another origin asks."""

    status, code = 403, "foreign_origin"


class OriginMiddleware:
    """Refuses requests for foreign hosts and from foreign pages before anything reads them."""

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self._app = app
        given = {part.strip().lower().strip("[]") for part in settings.allowed_hosts.split(",")}
        # Small letters, without ports.
        self._names = {_LOCAL, settings.host.lower(), _public_host(settings), *given} - {""}
        # A page can be given any name, but no address that it was not fetched from; beyond
        # loopback nobody knows all names and addresses that lead here.
        self._any_address = not is_loopback(settings.host)
        if self._any_address:
            self._names |= {socket.gethostname().lower()}
        self._public = _origin(settings.public_url or "")

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on.

        Raises:
            MisdirectedError: it is for another host.
            ForeignOriginError: a page of another origin asks.
            NotFoundError: its path ends a line.
        """
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        self._check(scope)
        await self._app(scope, receive, send)

    def _check(self, scope: Scope) -> None:
        # The router's patterns end with $, before which a line may end: no second spelling of a
        # path, whose limits go by the first.
        if scope["path"].endswith("\n"):
            raise NotFoundError(f"path: none ends a line, got {scope['path']!a:.80}")
        headers = Headers(scope=scope)
        # A load balancer asks by any address, or by none; the answer tells nothing.
        if scope["path"] != "/healthz":
            for host in headers.getlist("host"):
                self._check_host(host)
        site = headers.get("sec-fetch-site")
        safe = scope.get("method") in _SAFE
        if site is not None:
            opened = headers.get("sec-fetch-mode") == "navigate"
            opened = opened and headers.get("sec-fetch-dest") == "document"
            if site not in _OURS and not (safe and opened):
                raise ForeignOriginError(
                    f"Sec-Fetch-Site: pages of this service alone may do this, got {site!r:.40}"
                )
        elif not safe:
            self._check_origin(headers)

    def _check_host(self, host: str) -> None:
        name = (_split(f"//{host}")[0] or "").rstrip(".")
        if name in self._names:
            return
        if _is_address(name) and (self._any_address or is_loopback(name)):
            return
        raise MisdirectedError(
            f"Host: this service does not go by {host!r:.80}; SUREFOOT_ALLOWED_HOSTS takes the "
            "names that it goes by"
        )

    def _check_origin(self, headers: Headers) -> None:
        for origin in headers.getlist("origin"):
            asked = _origin(origin)
            here = _origin(f"{origin.partition(':')[0]}://{headers.get('host', '')}")
            if asked is None or asked not in (here, self._public):
                raise ForeignOriginError(
                    f"Origin: pages of this service alone may do this, got {origin!r:.80}"
                )


def _is_address(name: str) -> bool:
    try:
        ip_address(name)
    except ValueError:
        return False
    return True


def _public_host(settings: Settings) -> str:
    return urlsplit(settings.public_url or "").hostname or ""


def _split(url: str) -> tuple[str | None, int | None]:
    try:
        parts = urlsplit(url)
        return parts.hostname, parts.port
    except ValueError:
        return None, None


def _origin(url: str) -> tuple[str, str, int] | None:
    """Scheme, host and port of a URL; None where it has none, as `null` has not."""
    host, port = _split(url)
    scheme = url.partition(":")[0].lower()
    if host is None or scheme not in _PORTS:
        return None
    return scheme, host, port or _PORTS[scheme]
