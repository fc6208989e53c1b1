"""Who has shown no token keeps nobody out who has, against a real server."""

import re
import socket
import time

import pytest

from service.access import tokens
from service.access.tokens import TokenSpec
from service.store.engines.store import Store
from tests.running import served, wait_for
from tests.service.api.test_connections import everything, follows, in_process

FEW = {"auth": "on", "max_connections": 12, "connections_per_address": 0}
LOGIN = (
    b"POST /ui/login HTTP/1.1\r\nHost: localhost\r\n"
    b"Content-Type: application/x-www-form-urlencoded\r\nContent-Length: %d\r\n\r\ntoken="
)

GAVE_WAY = (b"", b"HTTP/1.1 408", b"HTTP/1.1 503")  # what is left of what it was told


@pytest.fixture
def bearer(settings):
    with Store(settings).write() as session:
        spec = TokenSpec(name="ada", scopes=("admin", "ingest"))
        return f"Authorization: Bearer {tokens.make_token(session, spec, None).text}".encode()


def ask(made, line, *headers, body=b""):
    """The whole answer over a connection that is kept open: its body may come by itself."""
    head = b"\r\n".join((line + b" HTTP/1.1", b"Host: localhost", *headers))
    made.sendall(head + b"\r\n\r\n" + body)
    answer = made.recv(65536)
    while b"\r\n\r\n" not in answer:
        answer += made.recv(65536)
    head, _, came = answer.partition(b"\r\n\r\n")
    length = int(re.search(rb"content-length: (\d+)", head.lower())[1])
    while len(came) < length:
        came += made.recv(65536)
    return answer


def slow_login(address):
    """A connection that has begun to log in, and does not go on."""
    made = socket.create_connection(address, timeout=10)
    made.sendall(LOGIN % 9_000)
    time.sleep(0.02)  # until it is seen
    return made


def test_slow_logins_keep_nobody_out(settings, bearer):
    """1,000 of these got every other request a 503 for as long as they dripped."""
    with in_process(settings, **FEW) as (address, _):
        held = socket.create_connection(address, timeout=10)
        assert ask(held, b"GET /cameras", bearer).startswith(b"HTTP/1.1 200 ")
        slow = [slow_login(address) for _ in range(20)]
        for path in (b"GET /healthz", b"GET /cameras"):
            new = socket.create_connection(address, timeout=10)
            assert ask(new, path, bearer).startswith(b"HTTP/1.1 200 ")
        # The oldest gave way; who has shown a token kept its place, and its next request.
        assert everything(slow[0])[:12] in GAVE_WAY
        assert ask(held, b"GET /cameras", bearer).startswith(b"HTTP/1.1 200 ")
        for made in slow:
            made.close()


def test_a_place_is_kept_while_a_body_is_sent(settings, bearer):
    """The token has come, the answer not yet."""
    with in_process(settings, **FEW) as (address, _):
        post = b"POST /cameras HTTP/1.1\r\nHost: localhost\r\nContent-Length: 9\r\n"
        sending = socket.create_connection(address, timeout=10)
        sending.sendall(post + b"Content-Type: application/json\r\n" + bearer + b"\r\n\r\n{")
        slow = [slow_login(address) for _ in range(20)]
        sending.sendall(b"       }")
        assert sending.recv(65536).startswith(b"HTTP/1.1 422 ")
        assert everything(slow[0])[:12] in GAVE_WAY
        for made in slow:
            made.close()


def test_those_who_have_tokens_are_refused_once_all_places_are_theirs(settings, bearer):
    with in_process(settings, **FEW) as (address, _):
        held = [socket.create_connection(address, timeout=10) for _ in range(12)]
        assert all(follows(made, bearer + b"\r\n") for made in held)
        beyond = socket.create_connection(address, timeout=10)
        assert everything(beyond).startswith(b"HTTP/1.1 503 ")
        held[0].close()

        def taken():
            new = socket.create_connection(address, timeout=10)
            return ask(new, b"GET /healthz").startswith(b"HTTP/1.1 200 ")

        wait_for(taken, 10)


def test_who_has_a_token_and_asks_nothing_makes_room_once(settings, bearer):
    """Those who keep connections open shut nobody out, and strangers get one place of theirs."""
    with in_process(settings, **FEW) as (address, _):
        idle = [socket.create_connection(address, timeout=10) for _ in range(12)]
        for made in idle:
            assert ask(made, b"GET /cameras", bearer).startswith(b"HTTP/1.1 200 ")
        slow = [slow_login(address) for _ in range(20)]
        assert everything(slow[0]).startswith(GAVE_WAY)
        assert everything(idle[0]) == b""
        for made in idle[1:]:
            assert ask(made, b"GET /cameras", bearer).startswith(b"HTTP/1.1 200 ")
        new = socket.create_connection(address, timeout=10)
        assert ask(new, b"GET /cameras", bearer).startswith(b"HTTP/1.1 200 ")
        assert everything(slow[-1]).startswith(GAVE_WAY)


def test_a_stranger_sends_a_token_and_no_more(settings, bearer):
    """440 bodies of a megabyte took the room of honest ones."""
    with in_process(settings, **FEW) as (address, _):
        made = socket.create_connection(address, timeout=10)
        made.sendall(LOGIN % (16 * 1024 + 1))
        assert made.recv(65536).startswith(b"HTTP/1.1 413 ")
        whole = socket.create_connection(address, timeout=10)
        whole.sendall(LOGIN % (16 * 1024) + b"x" * (16 * 1024 - 6))
        assert whole.recv(65536).startswith(b"HTTP/1.1 401 ")


def test_no_answer_tells_what_serves_it(tmp_path, migrated):
    with served(tmp_path, migrated) as running:
        assert "server" not in running.http.get("/healthz").headers


def test_the_answer_to_a_body_too_large_is_read(settings, bearer):
    """It ended in a reset, since the rest of the body was not read."""
    size = 64 * 2**20
    post = b"POST /cameras/c/tracks HTTP/1.1\r\nHost: localhost\r\nContent-Length: %d\r\n" % size
    with in_process(settings, **FEW) as (address, _):
        made = socket.create_connection(address, timeout=10)
        made.sendall(post + bearer + b"\r\n\r\n")
        for _ in range(size // 2**20):
            made.sendall(b" " * 2**20)
        assert made.recv(65536).startswith(b"HTTP/1.1 413 ")
        # The connection goes on to be used.
        assert ask(made, b"GET /healthz").startswith(b"HTTP/1.1 200 ")
