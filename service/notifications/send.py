"""One request to a webhook: to a checked address, within a deadline, without following anything."""

import email.utils
import ssl
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache
from typing import Any

import httpcore
import httpx

from service.notifications.addresses import AddressError, Networks, checked_addresses, read_url

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
    backend = CheckedBackend(allowed, lambda: deadline_s - time.monotonic())
    with (
        httpcore.ConnectionPool(ssl_context=_tls(), network_backend=backend) as pool,
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
    """Connects to addresses that were checked in the same breath; all within one deadline."""

    def __init__(self, allowed: Networks, left_s: Callable[[], float]) -> None:
        self._allowed = allowed
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
        for address in checked_addresses(host, port, self._allowed):
            try:
                stream = self._plain.connect_tcp(
                    address, port, _left(self._left_s), local_address, socket_options
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
        return self._inner.read(max_bytes, _left(self._left_s))

    def write(self, buffer: bytes, timeout: float | None = None) -> None:
        """Send bytes."""
        self._inner.write(buffer, _left(self._left_s))

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
        inner = self._inner.start_tls(ssl_context, server_hostname, _left(self._left_s))
        return DeadlineStream(inner, self._left_s)

    def get_extra_info(self, info: str) -> Any:
        """An answer of the inner stream."""
        return self._inner.get_extra_info(info)


def _left(left_s: Callable[[], float]) -> float:
    left = left_s()
    if left <= 0:
        raise httpcore.ReadTimeout("the deadline has passed")
    return left


def _seconds(text: str) -> float | None:
    """`Retry-After`: seconds, or a date."""
    if text.strip().isdecimal():
        return float(text)
    try:
        at = email.utils.parsedate_to_datetime(text)
    except (TypeError, ValueError):
        return None
    return None if at.tzinfo is None else max((at - datetime.now(UTC)).total_seconds(), 0.0)


@lru_cache(maxsize=1)
def _tls() -> ssl.SSLContext:
    """Well-known authorities, or those that SSL_CERT_FILE names."""
    return httpx.create_ssl_context()
