"""One request to a webhook: to a checked address, within a deadline, without following anything.

Private addresses only where the operator allows them. The check is on addresses that a name
resolves to, never on how the name is spelt, so `http://2130706433/` is seen as 127.0.0.1. It is
made when a webhook is created and again before each request, which connects to the very address
that was checked: a resolver that changes its answer between check and connection gains nothing.
"""

import email.utils
import socket
import ssl
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache, partial
from ipaddress import IPv4Address, IPv4Network, IPv6Address, IPv6Network, ip_address
from typing import Any

import httpcore
import httpx

Networks = Sequence[IPv4Network | IPv6Network]

MAX_URL_LENGTH = 2000
_PORTS = {"http": 80, "https": 443}


class AddressError(ValueError):
    """A URL that nothing may be sent to; the message gives the limit and the value."""


def read_url(text: str) -> httpx.URL:
    """The parsed URL.

    Raises:
        AddressError: it is no plain http or https URL.
    """
    if len(text) > MAX_URL_LENGTH:
        raise AddressError(f"at most {MAX_URL_LENGTH} characters are taken, got {len(text)}")
    try:
        url = httpx.URL(text)
    except (httpx.InvalidURL, UnicodeError) as error:
        raise AddressError(f"a URL is needed: {error}") from error
    if url.scheme not in _PORTS:
        raise AddressError(f"http or https is needed, got {url.scheme or 'no scheme'!r}")
    if url.userinfo:
        raise AddressError("user names and passwords in a URL are not taken")
    if not url.host:
        raise AddressError(f"a host is needed, got {text!r:.80}")
    if url.port is not None and not 0 < url.port < 65536:
        raise AddressError(f"a port from 1 to 65535 is needed, got {url.port}")
    return url


def check_url(text: str, allowed: Networks) -> httpx.URL:
    """The parsed URL, if its host resolves to addresses that may be reached. Asks the resolver.

    Raises:
        AddressError: it is no plain http or https URL, or leads where it must not.
    """
    url = read_url(text)
    checked_addresses(url.host, port_of(url), allowed)
    return url


def port_of(url: httpx.URL) -> int:
    """The port of a URL, or that of its scheme."""
    return url.port or _PORTS[url.scheme]


def checked_addresses(
    host: str, port: int, allowed: Networks, setting: str = "SUREFOOT_WEBHOOK_ALLOW"
) -> list[str]:
    """The addresses of a host; each is public or allowed by a setting.

    Raises:
        AddressError: it has none, or one of them may not be reached.
    """
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError) as error:
        raise AddressError(f"the host {host!r} does not resolve: {error}") from error
    addresses = list(dict.fromkeys(str(entry[4][0]) for entry in found))
    for address in addresses:
        if not may_reach(address, allowed):
            ranges = ", ".join(str(network) for network in allowed) or "none"
            raise AddressError(
                f"the host {host!r} resolves to {address}, which is private or reserved; "
                f"{setting} names those that may be reached: {ranges}"
            )
    return addresses


def may_reach(address: str, allowed: Networks, *, public: bool = True) -> bool:
    """True where an address is in a network that is allowed, or, unless they are not, `public`."""
    ip = _inner(ip_address(address))
    return (public and _is_public(ip)) or any(ip in network for network in allowed)


def _inner(ip: IPv4Address | IPv6Address) -> IPv4Address | IPv6Address:
    """The IPv4 address that an IPv6 address stands for, if it does."""
    if isinstance(ip, IPv4Address):
        return ip
    return ip.ipv4_mapped or ip.sixtofour or ip


def _is_public(ip: IPv4Address | IPv6Address) -> bool:
    # Python counts multicast and the old site-local addresses as global; NAT64 ones are reserved.
    if isinstance(ip, IPv6Address) and ip.is_site_local:
        return False
    return ip.is_global and not (ip.is_multicast or ip.is_reserved or ip.is_unspecified)


TIMEOUT_S = 15.0
_MOST_READ = 4096  # bytes of an answer
_MOST_TOLD = 200  # characters of it in an error


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """The outcome of an attempt: a status code, or an error that stood before one."""

    started_at: datetime
    duration_s: float
    status_code: int | None
    error: str | None
    retry_after_s: float | None = None

    @property
    def ok(self) -> bool:
        """The receiver has taken it."""
        return self.status_code is not None and 200 <= self.status_code < 300


def post(
    url: str,
    headers: dict[str, str],
    body: str,
    allowed: Networks,
    timeout_s: float = TIMEOUT_S,
) -> Outcome:
    """Post JSON to a URL; what goes wrong is in the outcome. Redirects and proxies are not used."""
    started_at, start_s = datetime.now(UTC), time.monotonic()
    status: int | None = None
    retry_after_s = None
    try:
        status, retry_after_s, text = _exchange(url, headers, body, allowed, start_s + timeout_s)
        error = None if 200 <= status < 300 else f"answered {status}: {text[:_MOST_TOLD]!r}"
    except AddressError as refused:
        error = f"url: {refused}"
    except httpcore.TimeoutException:
        error = f"no answer within {timeout_s:g} s"
    except (httpcore.NetworkError, httpcore.ProtocolError, OSError) as failed:
        error = f"{type(failed).__name__}: {failed}"
    return Outcome(
        started_at=started_at,
        duration_s=time.monotonic() - start_s,
        status_code=status,
        error=error,
        retry_after_s=retry_after_s,
    )


def _exchange(
    url: str, headers: dict[str, str], body: str, allowed: Networks, deadline_s: float
) -> tuple[int, float | None, str]:
    """Status code, `Retry-After` in seconds and the first bytes of an answer."""
    parsed = read_url(url)
    content = body.encode()
    sent: list[tuple[bytes | str, bytes | str]] = [
        ("Host", parsed.netloc.decode()),
        ("User-Agent", "surefoot"),
        ("Content-Type", "application/json"),
        ("Content-Length", str(len(content))),
        ("Connection", "close"),
        *headers.items(),
    ]
    target = httpcore.URL(
        scheme=parsed.raw_scheme, host=parsed.raw_host, port=parsed.port, target=parsed.raw_path
    )
    backend = CheckedBackend(
        partial(checked_addresses, allowed=allowed), lambda: deadline_s - time.monotonic()
    )
    with (
        httpcore.ConnectionPool(ssl_context=tls_context(), network_backend=backend) as pool,
        pool.stream("POST", target, headers=sent, content=content) as answer,
    ):
        given = {name.lower(): value for name, value in answer.headers}
        text = b""
        if not 200 <= answer.status < 300:  # of a success, nothing more is asked
            for part in answer.iter_stream():
                text += part
                if len(text) >= _MOST_READ:
                    break
        after_s = _seconds(given.get(b"retry-after", b"").decode(errors="replace"))
        return answer.status, after_s, text[:_MOST_READ].decode(errors="replace").strip()


class CheckedBackend(httpcore.NetworkBackend):
    """Connects to checked addresses of a host, within one deadline.

    Args:
        addresses: the checked addresses of a host and port; no name is resolved but by this.
        left_s: seconds until the deadline of everything together.
    """

    def __init__(
        self, addresses: Callable[[str, int], Sequence[str]], left_s: Callable[[], float]
    ) -> None:
        self._addresses = addresses
        self._left_s = left_s
        self._plain = httpcore.SyncBackend()

    def connect_tcp(
        self,
        host: str,
        port: int,
        timeout: float | None = None,
        local_address: str | None = None,
        socket_options: Iterable[Any] | None = None,
    ) -> httpcore.NetworkStream:
        """A connection to the first address of a host that answers."""
        failed: Exception | None = None
        for address in self._addresses(host, port):
            try:
                stream = self._plain.connect_tcp(
                    address, port, _left(self._left_s, timeout), local_address, socket_options
                )
            except (httpcore.ConnectError, httpcore.ConnectTimeout) as error:
                failed = error
                continue
            return DeadlineStream(stream, self._left_s)
        assert failed is not None
        raise failed


class DeadlineStream(httpcore.NetworkStream):
    """A stream whose every wait ends at the deadline: a byte now and then does not prolong it."""

    def __init__(self, inner: httpcore.NetworkStream, left_s: Callable[[], float]) -> None:
        self._inner = inner
        self._left_s = left_s

    def read(self, max_bytes: int, timeout: float | None = None) -> bytes:
        """Some bytes."""
        return self._inner.read(max_bytes, _left(self._left_s, timeout))

    def write(self, buffer: bytes, timeout: float | None = None) -> None:
        """Send bytes."""
        self._inner.write(buffer, _left(self._left_s, timeout))

    def close(self) -> None:
        """Close the connection."""
        self._inner.close()

    def start_tls(
        self,
        ssl_context: ssl.SSLContext,
        server_hostname: str | None = None,
        timeout: float | None = None,
    ) -> httpcore.NetworkStream:
        """The same in TLS; the certificate must be of the name, whatever address it has."""
        inner = self._inner.start_tls(ssl_context, server_hostname, _left(self._left_s, timeout))
        return DeadlineStream(inner, self._left_s)

    def get_extra_info(self, info: str) -> Any:
        """An answer of the inner stream."""
        return self._inner.get_extra_info(info)


def _left(left_s: Callable[[], float], timeout: float | None) -> float:
    """Seconds that one wait may take: its own timeout, if any, but no longer than the deadline."""
    left = left_s()
    if left <= 0:
        raise httpcore.ReadTimeout("the deadline has passed")
    return left if timeout is None else min(left, timeout)


def _seconds(text: str) -> float | None:
    """`Retry-After`: seconds, or a date."""
    if text.strip().isdecimal():
        return float(text)
    try:
        at = email.utils.parsedate_to_datetime(text)
    except (TypeError, ValueError, OverflowError):
        return None
    return None if at.tzinfo is None else max((at - datetime.now(UTC)).total_seconds(), 0.0)


@lru_cache(maxsize=1)
def tls_context() -> ssl.SSLContext:
    """Well-known authorities, or those that SSL_CERT_FILE names."""
    return httpx.create_ssl_context()
