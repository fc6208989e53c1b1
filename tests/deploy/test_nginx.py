"""The proxy of the example, before a real service: what it buffers, limits and takes off."""

import datetime
import json
import os
import shutil
import socket
import ssl
import subprocess
import time
from types import SimpleNamespace

import httpx
import psutil
import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec

from service.access import tokens
from service.access.tokens import TokenSpec
from service.settings import Settings
from service.store.engines.store import Store
from tests.conftest import CAMERA, ROOT, track
from tests.running import free_port, served, wait_for

NGINX = os.environ.get("SUREFOOT_TEST_NGINX") or shutil.which("nginx")
EXAMPLE = ROOT / "deploy" / "nginx.conf"
SECRET = "a secret of the proxy"
pytestmark = pytest.mark.skipif(NGINX is None, reason="no nginx here (Debian: nginx)")


def certify(folder):
    """A certificate for this machine, signed by itself."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "surefoot.example")])
    now = datetime.datetime.now(datetime.UTC)
    made = x509.CertificateBuilder(name, name, key.public_key(), x509.random_serial_number())
    made = made.not_valid_before(now).not_valid_after(now + datetime.timedelta(days=1))
    pem = made.sign(key, hashes.SHA256()).public_bytes(serialization.Encoding.PEM)
    (folder / "surefoot.pem").write_bytes(pem)
    private = key.private_bytes(
        serialization.Encoding.PEM,
        serialization.PrivateFormat.PKCS8,
        serialization.NoEncryption(),
    )
    (folder / "surefoot.key").write_bytes(private)


@pytest.fixture(scope="module")
def proxied(migrated, tmp_path_factory):
    """nginx by the example, but for ports and paths, before a service with a token."""
    folder = tmp_path_factory.mktemp("nginx")
    certify(folder)
    changes = {"public_url": "https://surefoot.example", "connections_per_address": 0}
    changes |= {"proxy_from": "127.0.0.1/32", "proxy_secret": SECRET}
    with served(folder, migrated, **changes) as api:
        port, conf = free_port(), EXAMPLE.read_text()
        for there, here in (
            ("listen 443", f"listen 127.0.0.1:{port}"),
            ("127.0.0.1:8080", f"127.0.0.1:{api.settings.port}"),
            ("/etc/ssl/", f"{folder}/"),
        ):
            assert there in conf
            conf = conf.replace(there, here)
        kinds = ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
        temporary = " ".join(f"{kind}_temp_path {folder}/{kind};" for kind in kinds)
        user = "user root;" if os.geteuid() == 0 else ""
        (folder / "nginx.conf").write_text(
            f"{user} daemon off; pid {folder}/nginx.pid; error_log {folder}/error.log;"
            f"events {{ worker_connections 512; }} http {{ access_log off; {temporary}\n{conf}}}"
        )
        command = [NGINX, "-p", str(folder), "-c", str(folder / "nginx.conf")]
        command += ["-e", str(folder / "error.log")]
        nginx = subprocess.Popen(command)
        with Store(api.settings).write() as session:
            spec = TokenSpec(name="ada", scopes=("admin", "ingest"))
            bearer = {"Authorization": f"Bearer {tokens.make_token(session, spec, None).text}"}
        http = httpx.Client(
            base_url=f"https://127.0.0.1:{port}",
            headers={"Host": "surefoot.example"},
            verify=False,  # its certificate was made a moment ago
            timeout=30,
        )
        try:
            wait_for(lambda: answers(http, nginx, folder), 20)
            http.post("/cameras", json=CAMERA, headers=bearer).raise_for_status()
            yield SimpleNamespace(http=http, bearer=bearer, port=port, api=api)
        finally:
            http.close()
            nginx.terminate()
            nginx.wait(10)


def answers(http, nginx, folder):
    assert nginx.poll() is None, (folder / "error.log").read_text()
    try:
        return http.get("/healthz").status_code == 200
    except httpx.TransportError:
        return False


def test_its_limits_are_the_defaults():
    text, defaults = EXAMPLE.read_text(), Settings()
    for limit_mb in (defaults.max_body_mb, defaults.max_tracks_body_mb, defaults.max_snapshot_mb):
        assert f"client_max_body_size {limit_mb:.0f}m;" in text


def test_posts_and_pages_go_through(proxied):
    body = {"tracks": [track(str(n)) for n in range(200)]}
    posted = proxied.http.post("/cameras/corner/tracks", json=body, headers=proxied.bearer)
    assert posted.json()["accepted"] == 200
    page = proxied.http.get("/", headers={**proxied.bearer, "Accept": "text/html"})
    assert page.status_code == 200
    with proxied.http.stream("GET", "/events", headers=proxied.bearer) as events:
        assert ": connected" in next(events.iter_text())


def test_bodies_too_large_are_refused_in_its_words(proxied):
    large = {"/cameras": 2**20, "/cameras/corner/tracks": 32 * 2**20, "/ui/login": 16 * 2**10}
    for path, most in large.items():
        answer = proxied.http.post(path, content=b" " * (most + 1), headers=proxied.bearer)
        assert (answer.status_code, answer.json()["code"]) == (413, "too_large")
        assert json.loads(answer.text)["status"] == 413


def test_pictures_may_be_larger_than_other_bodies(proxied):
    jpeg = {**proxied.bearer, "Content-Type": "image/jpeg"}
    for method, kind in (("PUT", "snapshot"), ("PUT", "plan"), ("POST", "aim")):
        path, body = f"/cameras/corner/{kind}", b" " * 2**21
        answer = proxied.http.request(method, path, content=body, headers=jpeg)
        assert answer.status_code != 413, answer.text  # pictures are off here, and this is none


def test_slow_bodies_wait_there_and_take_no_connection_of_ours(proxied):
    head = (
        "POST /cameras/corner/tracks HTTP/1.1\r\nHost: surefoot.example\r\n"
        f"Authorization: {proxied.bearer['Authorization']}\r\n"
        "Content-Type: application/json\r\nContent-Length: 1000000\r\n\r\n{"
    )
    context = ssl.create_default_context()
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    before = len(psutil.Process(proxied.api.process.pid).net_connections())
    slow = []
    for _ in range(30):
        plain = socket.create_connection(("127.0.0.1", proxied.port), timeout=10)
        slow.append(context.wrap_socket(plain))
        slow[-1].sendall(head.encode())
    time.sleep(0.5)
    held = len(psutil.Process(proxied.api.process.pid).net_connections())
    for each in slow:
        each.close()
    assert held <= before


def test_nobody_says_through_it_who_they_are(proxied):
    said = {"X-Surefoot-Proxy": SECRET, "X-Forwarded-User": "eve", "X-Forwarded-Role": "admin"}
    assert proxied.http.get("/cameras", headers=said).status_code == 401


def test_logins_are_limited(proxied):
    form = {"token": "sf_wrong"}
    said = {"Origin": "https://surefoot.example"}
    got = [proxied.http.post("/ui/login", data=form, headers=said).status_code for _ in range(25)]
    assert got[0] == 401
    assert got[-1] == 429
    assert proxied.http.get("/healthz").status_code == 200
