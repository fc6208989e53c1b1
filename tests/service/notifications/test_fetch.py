"""Pictures are asked of addresses that may be reached, in bounds, a password of allowed ones."""

import base64
import hashlib
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from service.notifications.fetch import FetchError, fetch

JPEG = b"\xff\xd8\xff a picture"


FORMS = (
    'realm="c", nonce="n", qop="auth-int"',
    'realm="c", nonce="n", algorithm=SHA-512-256, qop="auth"',
    'realm="c", nonce="n", stale',
)


class Camera(BaseHTTPRequestHandler):
    """A camera with one picture, for the user `viewer` where it asks for one."""

    def do_GET(self):
        self.server.asked.append((self.path, self.headers.get("Authorization", "")))
        kind = self.path.strip("/")
        given = self.headers.get("Authorization", "")
        if kind in ("basic", "digest", "odd") and not self.known(kind, given):
            how = {
                "basic": 'Basic realm="c"',
                "digest": 'Digest realm="c", nonce="n", qop="auth", algorithm=MD5',
                "odd": "Negotiate",
            }[kind]
            return self.answer(401, b"", {"WWW-Authenticate": how})
        if kind.startswith("form"):
            return self.answer(401, b"", {"WWW-Authenticate": f"Digest {FORMS[int(kind[4:])]}"})
        if kind == "moved":
            return self.answer(302, b"", {"Location": "/picture"})
        return self.answer(200, JPEG * (100_000 if kind == "large" else 1), {})

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
        for name, value in {"Content-Type": "image/jpeg", **headers}.items():
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


@pytest.fixture
def known(settings):
    return settings.model_copy(
        update={
            "snapshot_allow": "127.0.0.0/8",
            "snapshot_user": "viewer",
            "snapshot_password": "secret",
            "max_snapshot_mb": 1.0,
        }
    )


@pytest.mark.parametrize("kind", ["picture", "basic", "digest"])
def test_a_picture_comes_whoever_it_asks_for(camera, known, kind):
    found = fetch(known, camera.url + kind)
    assert (found.content, found.media_type) == (JPEG, "image/jpeg")
    assert camera.asked[0][1] == ""  # nothing is sent to who does not ask


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        ("moved", "answered 302"),
        ("large", "at most 1048576 bytes"),
        ("odd", "it asks for 'negotiate'"),
    ],
)
def test_what_is_no_picture_is_named(camera, known, kind, said):
    with pytest.raises(FetchError, match=said):
        fetch(known, camera.url + kind)


def test_private_addresses_are_asked_where_they_are_allowed_alone(camera, settings):
    with pytest.raises(FetchError, match="SUREFOOT_SNAPSHOT_ALLOW names those"):
        fetch(settings, camera.url)
    assert camera.asked == []


def test_a_wrong_password_is_said_and_a_missing_one(camera, known):
    wrong = known.model_copy(update={"snapshot_password": "other"})
    for kind in ("basic", "digest"):
        with pytest.raises(FetchError, match=f"{kind} with the user viewer is refused"):
            fetch(wrong, camera.url + kind)
    with pytest.raises(FetchError, match="SUREFOOT_SNAPSHOT_USER"):
        fetch(known.model_copy(update={"snapshot_user": None}), camera.url + "basic")


@pytest.mark.parametrize("form", range(len(FORMS)))
def test_a_digest_of_an_unknown_form_is_named(camera, known, form):
    with pytest.raises(FetchError, match="digest of an unknown form"):
        fetch(known, f"{camera.url}form{form}")


def test_no_answer_is_told(known):
    with pytest.raises(FetchError, match="ConnectError"):
        fetch(known, "http://127.0.0.1:9/")
