"""Clients that only keep their place, against a real server."""

import contextlib
import socket
import threading
import time

import psutil
import pytest
import uvicorn

from service.api.middleware.connections import ConnectionGuard, GuardedProtocol
from service.app import create_app
from service.commands.serve import listen
from tests.conftest import CAMERA
from tests.running import served, wait_for


def patience_of(seconds):
    """The settings of an API that has few connections, and cuts who is silent for so long."""
    few = {"max_connections": 40, "connections_per_address": 0}
    return {**few, "head_timeout_s": seconds, "stall_timeout_s": seconds}


@pytest.fixture(scope="module")
def api(migrated, tmp_path_factory):
    """One that loses patience soon."""
    with served(tmp_path_factory.mktemp("api"), migrated, **patience_of(2.0)) as running:
        yield running


@pytest.fixture
def patient_api(migrated, tmp_path):
    """One that cuts nobody for silence within a test."""
    with served(tmp_path, migrated, **patience_of(300.0)) as running:
        yield running


def connect(api, text=b""):
    made = socket.create_connection(("127.0.0.1", api.settings.port), timeout=10)
    if text:
        made.sendall(text)
    return made


LATE = b"HTTP/1.1 408 "


def everything(made):
    """All that comes until the other side closes."""
    found = b""
    with contextlib.suppress(ConnectionResetError):
        while chunk := made.recv(65536):
            found += chunk
    return found


def cut_off(made, text, times, every_s):
    """Whether the other side ends the connection before a text was sent so often."""
    for _ in range(times):
        try:
            made.sendall(text)
        except OSError:
            return True
        time.sleep(every_s)
    return False


def test_headers_and_bodies_that_do_not_come_are_cut(api):
    silent, half = connect(api), connect(api, b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n")
    body = connect(api, b"POST /cameras HTTP/1.1\r\nHost: [::1]\r\nContent-Length: 900\r\n\r\n{")
    for made in (silent, half, body):
        assert everything(made).startswith(b"HTTP/1.1 408 ")
    # A drip of headers is no progress.
    drip = connect(api, b"GET /healthz HTTP/1.1\r\n")
    assert cut_off(drip, b"X: 1\r\n", 400, 0.05)


def test_a_slow_but_moving_body_is_taken(api):
    head = b"POST /cameras HTTP/1.1\r\nHost: [::1]\r\nContent-Length: 9000\r\nConnection: close\r\n"
    made = connect(api, head + b"Content-Type: application/json\r\n\r\n")
    for _ in range(9):  # longer than the API's patience, in all
        made.sendall(b" " * 1000)
        time.sleep(0.3)
    assert everything(made).startswith(b"HTTP/1.1 422 ")


def test_the_silent_make_room_and_no_descriptor_is_lost(patient_api):
    api = patient_api
    before = psutil.Process(api.process.pid).num_fds()
    half = [connect(api, b"GET /healthz HTTP/1.1\r\nX: ") for _ in range(120)]
    wait_for(lambda: psutil.Process(api.process.pid).num_fds() <= before + 41, 10, 0.05)
    assert api.http.get("/healthz").status_code == 200
    for made in half:
        made.close()
    wait_for(lambda: psutil.Process(api.process.pid).num_fds() <= before + 2, 10)
    cut = api.http.get("/metrics").text
    assert 'surefoot_http_connections_refused_total{reason="silent"}' in cut


def test_a_client_that_takes_no_answer_is_cut(api):
    made = connect(api)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    assert cut_off(made, b"GET /openapi.json HTTP/1.1\r\nHost: localhost\r\n\r\n", 2000, 0.005)


@contextlib.contextmanager
def in_process(settings, **more):
    """A server in a thread; the sockets of its connections."""
    app, sockets = create_app(settings.model_copy(update=more)), []

    class Noting(GuardedProtocol):
        def connection_made(self, transport):
            sockets.append(transport.get_extra_info("socket"))
            super().connection_made(transport)

    guard = ConnectionGuard(settings.model_copy(update=more), app.state.instruments)
    listener = listen(settings.model_copy(update={"port": 0}))
    how = {"http": lambda **more: Noting(guard=guard, **more), "timeout_graceful_shutdown": 1}
    server = uvicorn.Server(uvicorn.Config(app, **how))
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]})
    thread.start()
    wait_for(lambda: server.started, 10, 0.01)
    yield listener.getsockname(), sockets
    server.should_exit = True
    thread.join()


def ask(made, path, end, more=b""):
    """Ask by a connection that is kept open, and read until the end of what has to come."""
    made.sendall(b"GET %s HTTP/1.1\r\nHost: localhost\r\n%s\r\n" % (path, more))
    found = b""
    while end not in found:
        chunk = made.recv(65536)
        assert chunk, found
        found += chunk
    return found.startswith(b"HTTP/1.1 200 ")


def asks(made):
    return ask(made, b"/healthz", b'{"status":"ok"}')


def follows(made, more=b""):
    return ask(made, b"/events", b": connected", more)


def healthy(address):
    made = socket.create_connection(address, timeout=10)
    made.sendall(b"GET /healthz HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")
    return everything(made).startswith(b"HTTP/1.1 200 ")


@pytest.mark.parametrize("given", [b"\xb2", b"9" * 30, b"-1"], ids=["digit", "large", "below"])
def test_a_last_event_id_that_is_none_opens_a_stream(api, given):
    made = connect(api)
    assert follows(made, b"Last-Event-ID: " + given + b"\r\n")
    made.close()


def test_who_knows_more_than_the_store_hears_what_comes(api):
    """A client of before the store was put back to an earlier one."""
    made = connect(api)
    assert follows(made, b"Last-Event-ID: 1000000\r\n")
    api.http.post("/cameras", json=CAMERA).raise_for_status()
    found = b""
    while b"event: pose" not in found:
        chunk = made.recv(65536)
        assert chunk, found
        found += chunk
    made.close()


def test_one_address_has_its_share(settings):
    with in_process(settings, connections_per_address=5) as (address, _):
        # Of connections that say nothing the oldest makes room, at once.
        silent = [socket.create_connection(address, timeout=10) for _ in range(7)]
        assert healthy(address)
        kept = [socket.create_connection(address, timeout=10) for _ in range(5)]
        assert all(asks(made) for made in kept)
        # Of five that were answered and are kept open who asks nothing for longest makes room.
        assert asks(kept[0])
        assert healthy(address)
        assert everything(kept[1]) == b""
        assert everything(silent[0])[: len(LATE)] in (b"", LATE)
        busy = [kept[0], *kept[2:], socket.create_connection(address, timeout=10)]
        assert all(follows(made) for made in busy)
        # Five that are being answered are the address's share.
        assert everything(socket.create_connection(address, timeout=10)).startswith(
            b"HTTP/1.1 503 "
        )
        busy[0].close()
        wait_for(lambda: healthy(address), 10)


def test_who_posts_every_few_seconds_keeps_his_connection(patient_api):
    """Longer than uvicorn's 5 s, at which a service closes as a client asks once more."""
    made = connect(patient_api)
    for pause_s in (0.0, 5.5):
        time.sleep(pause_s)
        assert asks(made)


def test_answers_do_not_wait_for_acknowledgements(settings):
    """Nagle's algorithm is off on the very sockets that are written to."""
    with in_process(settings) as (address, sockets):
        made = socket.create_connection(address, timeout=10)
        wait_for(lambda: sockets, 10, 0.01)
        assert sockets[0].getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY) == 1
        made.close()
