"""One picture asked of a camera: from a checked address, within a deadline and a size."""

import time
from collections.abc import Generator, Iterator
from dataclasses import dataclass

import httpcore
import httpx

from service.notifications.send import AddressError, CheckedBackend, Networks, read_url, tls_context
from service.settings import Settings

_DEADLINE_S = 15.0


class FetchError(Exception):
    """Why no picture came; the message has what was asked for and what came."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fetched:
    """The bytes of an answer, of a type."""

    content: bytes
    media_type: str


def fetch(settings: Settings, url: str) -> Fetched:
    """The picture at a URL; with the user and password of the settings where they are asked for.

    These go to networks of `SUREFOOT_SNAPSHOT_ALLOW` alone.

    Raises:
        FetchError: it may not be reached, does not answer in time, or with no picture.
    """
    networks, most = settings.snapshot_networks, int(settings.max_snapshot_mb * 2**20)
    end_s = time.monotonic() + _DEADLINE_S
    try:
        read_url(url)
        with httpx.Client(transport=_Checked(networks, end_s), timeout=_DEADLINE_S) as client:
            try:
                return _read(client, url, most, auth=None)
            except _Asked as asked:
                auth = _auth(settings, asked.scheme)
        # Whoever asks for a password gets it within what is allowed alone, and nowhere else.
        inside = _Checked(networks, end_s, public=False)
        with httpx.Client(transport=inside, timeout=_DEADLINE_S) as client:
            return _read(client, url, most, auth)
    except AddressError as error:
        raise FetchError(f"snapshot_url: {error}") from error
    except _Asked as asked:
        user = settings.snapshot_user
        raise FetchError(f"{asked.scheme} with the user {user} is refused") from None
    except (httpcore.TimeoutException, httpx.TimeoutException) as error:
        raise FetchError(f"no whole picture within {_DEADLINE_S:g} s") from error
    except (httpx.HTTPError, httpcore.NetworkError, httpcore.ProtocolError, OSError) as error:
        raise FetchError(f"{type(error).__name__}: {error}") from error


class _Digest(httpx.DigestAuth):
    """Digest; a challenge of a form that httpx does not know is an error of its own kind here."""

    def auth_flow(self, request: httpx.Request) -> Generator[httpx.Request, httpx.Response, None]:
        """The requests that it takes."""
        try:
            yield from super().auth_flow(request)
        except (KeyError, ValueError, NotImplementedError) as error:
            raise FetchError(f"it asks for a digest of an unknown form: {error}") from error


class _Asked(Exception):
    """An answer that asks for a user and password, in a scheme."""

    def __init__(self, scheme: str) -> None:
        super().__init__(scheme)
        self.scheme = scheme


def _auth(settings: Settings, scheme: str) -> httpx.Auth:
    user, password = settings.snapshot_user, settings.snapshot_password
    if user is None or password is None:
        raise FetchError(f"it asks for a user ({scheme}): set SUREFOOT_SNAPSHOT_USER, _PASSWORD")
    if scheme == "digest":
        return _Digest(user, password)
    if scheme == "basic":
        return httpx.BasicAuth(user, password)
    raise FetchError(f"it asks for {scheme!r:.40}; basic and digest are known")


def _read(client: httpx.Client, url: str, most: int, auth: httpx.Auth | None) -> Fetched:
    with client.stream("GET", url, auth=auth, headers={"User-Agent": "surefoot"}) as answer:
        if answer.status_code == httpx.codes.UNAUTHORIZED:
            words = answer.headers.get("www-authenticate", "").split()
            raise _Asked(words[0].lower() if words else "nothing")
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


class _Checked(httpx.BaseTransport):
    """Requests to addresses that are checked as they are connected to; one connection each."""

    def __init__(self, networks: Networks, end_s: float, *, public: bool = True) -> None:
        self._pool = httpcore.ConnectionPool(
            ssl_context=tls_context(),
            network_backend=CheckedBackend(
                networks,
                lambda: end_s - time.monotonic(),
                setting="SUREFOOT_SNAPSHOT_ALLOW",
                public=public,
            ),
        )

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
