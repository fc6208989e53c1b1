"""Where webhooks may lead: by resolved addresses, at creation and at each connection."""

import shutil
import socket
import ssl
import subprocess
from ipaddress import ip_network

import pytest

from service.notifications import send
from service.notifications.send import AddressError, check_url, may_reach, post
from tests.service.conftest import problem
from tests.service.notifications.receiver import receiver

LOOPBACK = (ip_network("127.0.0.0/8"),)

PRIVATE = [
    "127.0.0.1", "127.8.8.8", "0.0.0.0", "10.0.0.1", "172.16.0.1", "172.31.255.255", "192.168.1.1",
    "169.254.169.254", "100.64.0.1", "100.127.255.255", "192.0.2.1", "198.18.0.1", "203.0.113.9",
    "224.0.0.1", "239.255.255.250", "240.0.0.1", "255.255.255.255", "::", "::1", "fe80::1",
    "fc00::1", "fd12:3456::1", "fec0::1", "ff02::1", "::ffff:10.0.0.1", "::ffff:127.0.0.1",
    "64:ff9b::a00:1", "2002:a00:1::", "2001:db8::1", "2001::1",
]  # fmt: skip
PUBLIC = ["93.184.215.14", "1.1.1.1", "172.32.0.1", "100.128.0.1", "2606:4700::1111",
          "::ffff:1.1.1.1", "2002:101:101::"]  # fmt: skip


@pytest.mark.parametrize("address", PRIVATE)
def test_private_and_reserved_addresses_are_not_reached(address):
    assert not may_reach(address, ())


@pytest.mark.parametrize("address", PUBLIC)
def test_public_ones_are(address):
    assert may_reach(address, ())


def test_an_allowed_network_is_reached_in_whatever_dress():
    allowed = (ip_network("10.0.0.0/24"), ip_network("fd00::/8"))
    assert may_reach("10.0.0.7", allowed)
    assert may_reach("::ffff:10.0.0.7", allowed)
    assert may_reach("fd00::7", allowed)
    assert not may_reach("10.0.1.7", allowed)


@pytest.mark.parametrize(
    "host",
    ["127.0.0.1", "2130706433", "0x7f000001", "127.1", "localhost", "[::1]",
     "[::ffff:10.0.0.1]", "[::ffff:7f00:1]", "10.0.0.1", "0"],
)  # fmt: skip
def test_the_spelling_of_a_host_hides_nothing(host):
    with pytest.raises(AddressError, match="private or reserved"):
        check_url(f"http://{host}/hook", ())


def resolves_to(monkeypatch, *answers):
    """Have names resolve to one list of addresses after the other; the last one stays."""
    left = list(answers)
    real = socket.getaddrinfo

    def getaddrinfo(host, port, *args, **more):
        if host == "127.0.0.1":  # as the connection itself asks
            return real(host, port, *args, **more)
        found = left.pop(0) if len(left) > 1 else left[0]
        family = {True: socket.AF_INET6, False: socket.AF_INET}
        return [(family[":" in a], socket.SOCK_STREAM, 6, "", (a, port)) for a in found]

    monkeypatch.setattr(send.socket, "getaddrinfo", getaddrinfo)


def test_a_name_of_a_public_and_a_private_address_is_refused(monkeypatch):
    resolves_to(monkeypatch, ["93.184.215.14", "10.0.0.1"])
    with pytest.raises(AddressError, match=r"'hooks.example.com' resolves to 10\.0\.0\.1"):
        check_url("https://hooks.example.com/", ())
    resolves_to(monkeypatch, ["93.184.215.14"])
    assert check_url("https://hooks.example.com/", ()).host == "hooks.example.com"


@pytest.mark.parametrize(
    ("url", "says"),
    [
        ("ftp://example.com/", "http or https is needed, got 'ftp'"),
        ("file:///etc/passwd", "http or https"),
        ("example.com/hook", "http or https is needed, got 'no scheme'"),
        ("http://", "a host is needed"),
        ("http://user:word@example.com/", "passwords"),
        ("http://example.com:99999/", "a port from 1 to 65535 is needed, got 99999"),
        ("http://0177.0.0.1/", "Invalid IPv4 address"),
        ("http://example.com/" + "x" * 2000, "at most 2000 characters are taken, got 2019"),
        ("http://nowhere.invalid/", "does not resolve"),
    ],
)
def test_what_is_no_url_to_send_to_is_refused_by_name(http, url, says):
    body = problem(http.post("/webhooks", json={"url": url}), 422, "malformed")
    assert body["errors"][0]["pointer"] == "/url"
    assert says in body["errors"][0]["reason"]
    assert body["detail"].startswith("url: ")


def test_a_private_url_is_refused_at_creation_and_at_change(http, monkeypatch):
    body = problem(http.post("/webhooks", json={"url": "http://10.1.2.3/"}), 422, "malformed")
    reason = "SUREFOOT_WEBHOOK_ALLOW names those that may be reached: none"
    assert reason in body["errors"][0]["reason"]
    assert http.get("/webhooks").json()["items"] == []
    resolves_to(monkeypatch, ["93.184.215.14"])
    made = http.post("/webhooks", json={"url": "https://hooks.example.com/a"}).json()
    resolves_to(monkeypatch, ["127.0.0.1"])
    changed = http.patch(f"/webhooks/{made['id']}", json={"url": "https://hooks.example.com/b"})
    problem(changed, 422, "malformed")
    assert http.get(f"/webhooks/{made['id']}").json()["url"] == "https://hooks.example.com/a"


def test_a_name_that_is_rebound_after_its_check_reaches_nothing(monkeypatch):
    with receiver() as inner:
        port = inner.url.split(":")[2].split("/")[0]
        url = f"http://hooks.example.com:{port}/hook"
        resolves_to(monkeypatch, ["93.184.215.14"], ["127.0.0.1"])
        assert check_url(url, ()).host == "hooks.example.com"
        outcome = post(url, {}, "{}", ())
        assert outcome.status_code is None
        assert "resolves to 127.0.0.1, which is private" in outcome.error
        assert inner.received == []


def test_a_connection_goes_to_the_address_that_was_checked_under_the_name_that_was_given(
    monkeypatch,
):
    """The resolver is asked once a connection: there is no second answer to go by."""
    with receiver() as inner:
        port = inner.url.split(":")[2].split("/")[0]
        asked = []
        real = socket.getaddrinfo

        def getaddrinfo(host, *args, **more):
            asked.append(host)
            return real("127.0.0.1" if host == "hooks.example.com" else host, *args, **more)

        monkeypatch.setattr(socket, "getaddrinfo", getaddrinfo)
        outcome = post(f"http://hooks.example.com:{port}/hook?a=b", {}, "{}", LOOPBACK)
        assert outcome.status_code == 204
        assert asked.count("hooks.example.com") == 1
        assert set(asked) <= {"hooks.example.com", "127.0.0.1"}
        (message,) = inner.received
        assert message.headers["host"] == f"hooks.example.com:{port}"
        assert message.path == "/hook?a=b"


@pytest.fixture
def certified(tmp_path, monkeypatch):
    """A TLS server on the loopback address, with a certificate of hooks.example.com."""
    if shutil.which("openssl") is None:
        pytest.skip("no openssl to make a certificate with")
    key, certificate = tmp_path / "key.pem", tmp_path / "cert.pem"
    subprocess.run(
        ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-keyout", key,
         "-out", certificate, "-subj", "/CN=hooks.example.com", "-addext",
         "subjectAltName=DNS:hooks.example.com"],
        check=True,
        capture_output=True,
    )  # fmt: skip
    monkeypatch.setenv("SSL_CERT_FILE", str(certificate))
    send.tls_context.cache_clear()
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(certificate, key)
    asked = []
    context.sni_callback = lambda _, name, __: asked.append(name)
    with receiver(tls=context) as inner:
        yield inner.url.split(":")[2].split("/")[0], inner, asked
    send.tls_context.cache_clear()


def test_tls_is_of_the_name_though_the_connection_is_to_an_address(certified, monkeypatch):
    port, inner, asked = certified
    resolves_to(monkeypatch, ["127.0.0.1"])
    assert post(f"https://hooks.example.com:{port}/hook", {}, "{}", LOOPBACK).status_code == 204
    assert asked == ["hooks.example.com"]
    assert len(inner.received) == 1
    outcome = post(f"https://other.example.com:{port}/hook", {}, "{}", LOOPBACK)
    assert outcome.status_code is None
    assert "certificate" in outcome.error.lower()
    assert len(inner.received) == 1


def test_a_proxy_of_the_environment_is_not_asked(monkeypatch):
    """It would connect for us, to wherever the name leads it."""
    with receiver() as inner, receiver() as proxy:
        for name in ("http_proxy", "HTTP_PROXY", "ALL_PROXY"):
            monkeypatch.setenv(name, proxy.url.removesuffix("/hook"))
        assert post(inner.url, {}, "{}", LOOPBACK).ok
        assert proxy.received == []


def test_authorities_that_cannot_be_read_fail_an_attempt_and_no_job(monkeypatch):
    monkeypatch.setenv("SSL_CERT_FILE", "/nowhere/at/all.pem")
    send.tls_context.cache_clear()
    outcome = post("https://127.0.0.1:9/", {}, "{}", LOOPBACK)
    send.tls_context.cache_clear()
    assert outcome.status_code is None
    assert "FileNotFoundError" in outcome.error
