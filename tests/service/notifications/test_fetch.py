"""Requests for images: addresses that may be reached, bounds, and where credentials are sent."""

import base64
import hashlib
import socket
import threading
import time
from contextlib import closing
from dataclasses import dataclass, replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from service.notifications import fetch as fetching
from service.notifications import send
from service.notifications.fetch import Credentials, FetchError, ImageSource, fetch
from service.notifications.host_backoff import HostBackoff
from service.settings import Settings
from tests.service.notifications.test_addresses import resolves_to

JPEG = b"\xff\xd8\xff a picture"


FORMS = (
    'realm="c", nonce="n", qop="auth-int"',
    'realm="c", nonce="n", algorithm=SHA-512-256, qop="auth"',
    'realm="c", nonce="n", stale',
)


BASIC = 'Basic realm="c"'
DIGEST = 'Digest realm="c", nonce="n", qop="auth", algorithm=MD5'
ASKS = {"basic": [BASIC], "digest": [DIGEST], "either": [BASIC, DIGEST], "odd": ["Negotiate"]}


class Camera(BaseHTTPRequestHandler):
    """A camera with one image; some of its paths ask for the user `viewer`."""

    def do_GET(self):
        self.server.asked.append((self.path, self.headers.get("Authorization", "")))
        kind = self.path.strip("/")
        given = self.headers.get("Authorization", "")
        if kind in ASKS and not self.known("basic" if kind == "basic" else "digest", given):
            return self.answer(401, b"", [("WWW-Authenticate", each) for each in ASKS[kind]])
        if kind.startswith("form"):
            asked = f"Digest {FORMS[int(kind[4:])]}"
            return self.answer(401, b"", [("WWW-Authenticate", asked)])
        if kind == "moved":
            return self.answer(302, b"", [("Location", "/picture")])
        return self.answer(200, JPEG * (100_000 if kind == "large" else 1), [])

    def known(self, kind, given):
        if kind == "basic":
            return given == "Basic " + base64.b64encode(b"viewer:secret").decode()
        parts = dict(part.strip().split("=", 1) for part in given[7:].split(",") if "=" in part)
        parts = {name: value.strip('"') for name, value in parts.items()}

        def md5(*words):
            return hashlib.md5(":".join(words).encode()).hexdigest()

        first, second = md5("viewer", "c", "secret"), md5("GET", self.path)
        words = (parts.get("nonce", ""), parts.get("nc", ""), parts.get("cnonce", ""), "auth")
        return parts.get("response") == md5(first, *words, second)

    def answer(self, status, body, headers):
        self.send_response(status)
        for name, value in [("Content-Type", "image/jpeg"), *headers]:
            self.send_header(name, value)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_):
        pass


@pytest.fixture
def camera():
    server = ThreadingHTTPServer(("127.0.0.1", 0), Camera)
    server.asked = []
    server.url = f"http://127.0.0.1:{server.server_port}/"
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield server
    server.shutdown()
    server.server_close()
    thread.join()


@dataclass
class Asking:
    """Requests for images of a camera, as a worker makes them."""

    settings: Settings
    source: ImageSource
    hosts: HostBackoff
    digests: int = 0

    def fetch(self, url, **source):
        asked = replace(self.source, url=url, **source)
        return fetch(self.settings, asked, self.hosts, self._on_digest, within_s=3.0)

    def _on_digest(self):
        self.digests += 1

    def set(self, **changes):
        self.settings = self.settings.model_copy(update=changes)


@pytest.fixture
def asking(settings):
    allowed = {"snapshot_allow": "127.0.0.0/8", "max_snapshot_mb": 1.0, "snapshot_basic_http": True}
    return Asking(
        settings=settings.model_copy(update=allowed),
        source=ImageSource(url="", credentials=Credentials(user="viewer", password="secret")),
        hosts=HostBackoff(10.0),
    )


@pytest.mark.parametrize("kind", ["picture", "basic", "digest", "either"])
def test_image_comes_with_and_without_credentials(camera, asking, kind):
    found = asking.fetch(camera.url + kind)
    assert (found.content, found.media_type) == (JPEG, "image/jpeg")
    assert camera.asked[0][1] == ""  # credentials are only sent if they are asked for
    assert asking.digests == (kind in ("digest", "either"))


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("moved", "answered 302"),
        ("large", "at most 1048576 bytes"),
        ("odd", "asks for 'negotiate'; only Digest and Basic"),
    ],
)
def test_answer_without_image_is_named(camera, asking, kind, message):
    with pytest.raises(FetchError, match=message):
        asking.fetch(camera.url + kind)


def test_private_addresses_are_reached_only_if_allowed(camera, asking):
    asking.set(snapshot_allow="")
    with pytest.raises(FetchError, match="SUREFOOT_SNAPSHOT_ALLOW names those"):
        asking.fetch(camera.url)
    assert camera.asked == []


def test_wrong_and_missing_credentials_are_named(camera, asking):
    wrong = Credentials(user="viewer", password="other")
    for kind in ("basic", "digest"):
        with pytest.raises(FetchError, match=f"rejects the user and password .*{kind}"):
            asking.fetch(camera.url + kind, credentials=wrong)
        with pytest.raises(FetchError, match="set the camera's snapshot_credentials"):
            asking.fetch(camera.url + kind, credentials=None)


@pytest.mark.parametrize("form", range(len(FORMS)))
def test_unsupported_digest_is_named(camera, asking, form):
    with pytest.raises(FetchError, match="Digest in an unsupported form"):
        asking.fetch(f"{camera.url}form{form}")


def test_refused_connection_is_named(asking):
    with pytest.raises(FetchError, match="ConnectError"):
        asking.fetch("http://127.0.0.1:9/")


def test_basic_over_http_sends_no_password_unless_set(camera, asking):
    """The password went in clear to every allowed camera that asked for it."""
    asking.set(snapshot_basic_http=False)
    with pytest.raises(FetchError, match="Basic over http, which sends the password in clear"):
        asking.fetch(camera.url + "basic")
    assert [given for _, given in camera.asked] == [""]


def test_basic_after_digest_sends_no_password(camera, asking):
    with pytest.raises(FetchError, match="has asked for Digest before"):
        asking.fetch(camera.url + "basic", digest_only=True)
    assert [given for _, given in camera.asked] == [""]
    assert asking.fetch(camera.url + "digest", digest_only=True).content == JPEG
    assert asking.digests == 0  # it is known already


def test_public_host_gets_no_credentials(camera, asking, monkeypatch):
    """Reached, because its address is public; it asks for a password in vain."""
    monkeypatch.setattr(send, "_is_public", lambda ip: str(ip) == "127.0.0.1")
    asking.set(snapshot_allow="10.0.0.0/8")
    with pytest.raises(FetchError, match=r"only sent to networks .*, got 127\.0\.0\.1"):
        asking.fetch(camera.url + "digest")
    assert [given for _, given in camera.asked] == [""]


def test_resolver_that_changes_its_answer_leads_nowhere_else(camera, asking, monkeypatch):
    """The second answer would have got the password."""
    with closing(socket.create_server(("127.0.0.2", camera.server_port))) as other:
        other.settimeout(0)
        resolves_to(monkeypatch, ["127.0.0.1"], ["127.0.0.2"])
        url = f"http://camera.example:{camera.server_port}/basic"
        assert asking.fetch(url).content == JPEG
        with pytest.raises(BlockingIOError):
            other.accept()
    assert len(camera.asked) == 2


def test_resolver_that_changes_to_a_private_address_reaches_nothing(camera, asking, monkeypatch):
    asking.set(snapshot_allow="10.0.0.0/8")
    url = f"http://camera.example:{camera.server_port}/picture"
    resolves_to(monkeypatch, ["10.0.0.1", "127.0.0.1"])
    with pytest.raises(FetchError, match=r"resolves to 127\.0\.0\.1, which is private"):
        asking.fetch(url)
    assert camera.asked == []


@pytest.fixture
def silent():
    """A host that accepts connections and never answers."""
    with closing(socket.create_server(("127.0.0.1", 0))) as listening:
        yield f"http://127.0.0.1:{listening.getsockname()[1]}"


def test_silent_host_is_left_alone_for_longer_and_longer(silent, asking, monkeypatch):
    monkeypatch.setitem(fetching._TIMEOUTS_S, "read", 0.2)
    with pytest.raises(FetchError, match="no whole image within 3 s") as first:
        asking.fetch(silent + "/one.jpg")
    assert first.value.retry_after_s is None
    begun_s = time.monotonic()
    for path in ("/one.jpg", "/two.jpg"):  # another camera of the same recorder
        with pytest.raises(FetchError, match="did not answer; the next request is in 2 s") as again:
            asking.fetch(silent + path)
        assert 1.5 < again.value.retry_after_s <= 2.0
    assert time.monotonic() - begun_s < 0.2
    clock_s = [time.monotonic()]
    monkeypatch.setattr(time, "monotonic", lambda: clock_s[0])
    pauses = []
    for _ in range(4):
        clock_s[0] += asking.hosts.left_s(silent) + 0.001
        asking.hosts.failed(silent)
        pauses.append(asking.hosts.left_s(silent))
    assert pauses == pytest.approx([4, 8, 10, 10])
    asking.hosts.answered(silent)
    assert asking.hosts.left_s(silent) == 0


def test_answer_ends_the_pause_of_a_host(camera, asking):
    asking.hosts.failed("http://127.0.0.1:1/")
    assert asking.fetch(camera.url + "picture").content == JPEG  # another port: another host
    with pytest.raises(FetchError, match="answered 302"):
        asking.fetch(camera.url + "moved")
    assert asking.hosts.left_s(camera.url) == 0
