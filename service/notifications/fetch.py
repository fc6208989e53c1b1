"""Requests for the image of a camera: to one checked address, within bounds of time and size."""

import time
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, field

import httpcore
import httpx

from service.addresses import origin_of
from service.notifications.host_backoff import HostBackoff
from service.notifications.send import (
    AddressError,
    CheckedBackend,
    checked_addresses,
    may_reach,
    port_of,
    read_url,
    tls_context,
)
from service.settings import Settings

DEADLINE_S = 15.0
_TIMEOUTS_S = dict(connect=3.0, read=5.0, write=5.0)  # of each wait
_SETTING = "SUREFOOT_SNAPSHOT_ALLOW"


class FetchError(Exception):
    """No image came; the message has the limit and the value received.

    `retry_after_s` is set if the host was not asked at all, because it did not answer before.
    """

    def __init__(self, message: str, retry_after_s: float | None = None) -> None:
        super().__init__(message)
        self.retry_after_s = retry_after_s


@dataclass(frozen=True, slots=True, kw_only=True)
class Credentials:
    """The user and password of a camera."""

    user: str
    password: str = field(repr=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageSource:
    """The address of a camera's image. With `digest_only`, Basic is refused."""

    url: str
    credentials: Credentials | None = None
    digest_only: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Fetched:
    """The bytes of an answer, of a type."""

    content: bytes
    media_type: str


def fetch(
    settings: Settings,
    source: ImageSource,
    hosts: HostBackoff,
    on_digest: Callable[[], None],
    within_s: float = DEADLINE_S,
) -> Fetched:
    """The image at an address.

    The host is resolved once. All requests go to the addresses that were checked then.

    Args:
        settings: networks that may be reached, and limits.
        source: the address, and the credentials of its camera.
        hosts: hosts that are not asked for a while.
        on_digest: called before the first answer to a request for Digest.
        within_s: deadline of all requests together.

    Raises:
        FetchError: the address may not be reached, or no image came in time.
    """
    if wait_s := hosts.left_s(source.url):
        raise FetchError(
            f"{origin_of(source.url)} did not answer; the next request is in {wait_s:.0f} s", wait_s
        )
    try:
        found = _fetch(settings, source, on_digest, time.monotonic() + within_s)
    except _UNANSWERED as error:
        hosts.failed(source.url)
        if isinstance(error, httpcore.TimeoutException):
            limits = ", ".join(f"{name} {each:g} s" for name, each in _TIMEOUTS_S.items())
            raise FetchError(f"no whole image within {within_s:g} s ({limits})") from error
        raise FetchError(f"{type(error).__name__}: {error}") from error
    except AddressError as error:  # a slow resolver is not asked each time either
        hosts.failed(source.url)
        raise FetchError(str(error)) from error
    except FetchError:
        hosts.answered(source.url)
        raise
    hosts.answered(source.url)
    return found


_UNANSWERED = (
    httpcore.TimeoutException,
    httpcore.NetworkError,
    httpcore.ProtocolError,
    httpx.HTTPError,
    OSError,
)


def _fetch(
    settings: Settings, source: ImageSource, on_digest: Callable[[], None], end_s: float
) -> Fetched:
    url, networks = read_url(source.url), settings.snapshot_networks
    addresses = checked_addresses(url.host, port_of(url), networks, _SETTING)
    backend = CheckedBackend(lambda *_: addresses, lambda: end_s - time.monotonic())
    most = int(settings.max_snapshot_mb * 2**20)
    with httpx.Client(transport=_Transport(backend)) as client:
        try:
            return _read(client, source.url, most, auth=None)
        except _AskedError as asked:
            scheme = asked.scheme
        outside = [each for each in addresses if not may_reach(each, networks, public=False)]
        if outside:
            raise FetchError(
                f"asks for credentials ({scheme}), which are only sent to networks that {_SETTING} "
                f"names, got {outside[0]}"
            )
        auth = _auth(settings, source, scheme)
        if scheme == "digest" and not source.digest_only:
            on_digest()
        try:
            return _read(client, source.url, most, auth)
        except _AskedError as asked:
            raise FetchError(
                f"rejects the user and password of snapshot_credentials ({asked.scheme})"
            ) from None


def _auth(settings: Settings, source: ImageSource, scheme: str) -> httpx.Auth:
    if scheme not in ("digest", "basic"):
        raise FetchError(f"asks for {scheme!r:.40}; only Digest and Basic are supported")
    if source.credentials is None:
        raise FetchError(f"asks for credentials ({scheme}): set the camera's snapshot_credentials")
    user, password = source.credentials.user, source.credentials.password
    if scheme == "digest":
        return _Digest(user, password)
    if source.digest_only:
        raise FetchError(
            "asks for Basic, but has asked for Digest before; if the camera was replaced, clear "
            "its snapshot_url and set it again"
        )
    if not source.url.lower().startswith("https:") and not settings.snapshot_basic_http:
        raise FetchError(
            "asks for Basic over http, which sends the password in clear: use Digest or https, or "
            "set SUREFOOT_SNAPSHOT_BASIC_HTTP=true"
        )
    return httpx.BasicAuth(user, password)


class _Digest(httpx.DigestAuth):
    """Digest that reports an unsupported challenge as a `FetchError`."""

    def auth_flow(self, request: httpx.Request) -> Generator[httpx.Request, httpx.Response, None]:
        """The requests that authentication takes."""
        try:
            yield from super().auth_flow(request)
        except (KeyError, ValueError, NotImplementedError) as error:
            raise FetchError(f"asks for Digest in an unsupported form: {error}") from error


class _AskedError(Exception):
    """The answer asks for credentials in a scheme."""

    def __init__(self, scheme: str) -> None:
        super().__init__(scheme)
        self.scheme = scheme


def _scheme(answer: httpx.Response) -> str:
    """The scheme that an answer asks for: Digest if it is one of several."""
    asked = [each.split() for each in answer.headers.get_list("www-authenticate")]
    schemes = [words[0].lower() for words in asked if words]
    return "digest" if "digest" in schemes else next(iter(schemes), "nothing")


def _read(client: httpx.Client, url: str, most: int, auth: httpx.Auth | None) -> Fetched:
    with client.stream("GET", url, auth=auth, headers={"User-Agent": "surefoot"}) as answer:
        if answer.status_code == httpx.codes.UNAUTHORIZED:
            raise _AskedError(_scheme(answer))
        if answer.status_code != httpx.codes.OK:
            raise FetchError(f"answered {answer.status_code}")
        content = bytearray()
        for part in answer.iter_raw():
            content += part
            if len(content) > most:
                raise FetchError(f"at most {most} bytes are taken, more came")
        return Fetched(
            content=bytes(content),
            media_type=answer.headers.get("content-type", "").split(";")[0].strip().lower(),
        )


class _Transport(httpx.BaseTransport):
    """Requests by the connections of a backend."""

    def __init__(self, backend: CheckedBackend) -> None:
        self._pool = httpcore.ConnectionPool(ssl_context=tls_context(), network_backend=backend)

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        """The answer to a request, its body unread."""
        answer = self._pool.handle_request(
            httpcore.Request(
                method=request.method,
                url=httpcore.URL(
                    scheme=request.url.raw_scheme,
                    host=request.url.raw_host,
                    port=request.url.port,
                    target=request.url.raw_path,
                ),
                headers=request.headers.raw,
                content=request.stream,
                extensions={"timeout": _TIMEOUTS_S},
            )
        )
        return httpx.Response(
            status_code=answer.status, headers=answer.headers, stream=_Stream(answer)
        )

    def close(self) -> None:
        """Close the connections."""
        self._pool.close()


class _Stream(httpx.SyncByteStream):
    def __init__(self, answer: httpcore.Response) -> None:
        self._answer = answer

    def __iter__(self) -> Iterator[bytes]:
        yield from self._answer.iter_stream()

    def close(self) -> None:
        self._answer.close()
