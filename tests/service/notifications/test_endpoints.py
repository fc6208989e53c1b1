"""What an endpoint answers, and what comes of it."""

import socket
import threading
from datetime import UTC, datetime, timedelta
from email.utils import format_datetime
from ipaddress import ip_network

import pytest

from service.notifications import send
from service.notifications.send import post
from service.settings import Settings
from tests.service.notifications.receiver import receiver
from tests.service.notifications.test_deliveries import LOOPBACK, until_next_s


def test_410_disables_the_endpoint(post_room, inbox):
    hook = post_room.hook(inbox.url)
    inbox.answer(410, 204)
    post_room.open("drift")
    post_room.open("no_data")
    post_room.send(hook)
    shown = post_room.show(hook)
    assert (shown["enabled"], shown["disabled_reason"]) == (
        False, "it answered 410: it is gone for good"
    )  # fmt: skip
    assert [d["state"] for d in post_room.log(hook)] == ["pending", "failed"]
    post_room.end("drift")
    assert len(post_room.log(hook)) == 2  # nothing is written for it any more
    post_room.send_now(hook)
    assert len(inbox.received) == 1
    post_room.http.patch(f"/webhooks/{hook['id']}", json={"enabled": True}).raise_for_status()
    post_room.send(hook)
    assert [m.json["data"]["kind"] for m in inbox.received] == ["drift", "no_data"]


@pytest.mark.parametrize("form", ["seconds", "date"])
def test_retry_after_is_heeded_within_limits(post_room, inbox, form):
    hook = post_room.hook(inbox.url)
    at = datetime.now(UTC) + timedelta(seconds=1000)
    asked = "1000" if form == "seconds" else format_datetime(at, usegmt=True)
    inbox.answer((429, {"Retry-After": asked}), (429, {"Retry-After": "99999999"}))
    post_room.open()
    post_room.send(hook)
    (delivery,) = post_room.log(hook)
    assert 990 < until_next_s(delivery) < 1100
    held = datetime.fromisoformat(post_room.show(hook)["held_until"])
    assert held - datetime.now(UTC) > timedelta(seconds=900)
    post_room.send_now(hook)
    (delivery,) = post_room.log(hook)
    assert 6 * 3600 <= until_next_s(delivery) < 6 * 3600 + 60


@pytest.mark.parametrize("nonsense", ["soon", "-5", "\u00b2", "", "Fri, 99 Nov 2026 25:00:00 GMT"])
def test_a_retry_after_that_says_nothing_is_passed_over(nonsense):
    assert send._seconds(nonsense) is None


def test_a_redirect_is_a_failure_and_is_not_followed(post_room, inbox):
    with receiver() as other:
        hook = post_room.hook(inbox.url)
        inbox.answer((307, {"Location": other.url}))
        post_room.open()
        post_room.send(hook)
        assert other.received == []
        assert post_room.log(hook)[0]["attempts"][0]["status_code"] == 307


def test_nothing_that_listens_is_a_failure_like_others(post_room):
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        hook = post_room.hook(f"http://127.0.0.1:{probe.getsockname()[1]}/")
        post_room.open()
        post_room.send(hook)
    attempt = post_room.log(hook)[0]["attempts"][0]
    assert attempt["status_code"] is None
    assert attempt["error"].startswith("ConnectError")


@pytest.mark.parametrize("drips", [False, True])
def test_a_receiver_that_never_ends_its_answer_is_left(drips):
    """A byte now and then does not keep the sender."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        left = threading.Event()

        def serve():
            connection, _ = server.accept()
            with connection:
                while not left.wait(0.05):
                    if drips:
                        connection.sendall(b"H")

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        url = f"http://127.0.0.1:{server.getsockname()[1]}/"
        outcome = post(url, {}, "{}", LOOPBACK, timeout_s=0.5)
        left.set()
        thread.join()
    assert outcome.status_code is None
    assert outcome.error == "no answer within 0.5 s"


def test_of_a_long_answer_little_is_read():
    """The sender hangs up: the receiver cannot send it all."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        cut = []

        def serve():
            connection, _ = server.accept()
            with connection:
                connection.recv(65536)
                connection.sendall(b"HTTP/1.1 500 X\r\nContent-Length: 1000000000\r\n\r\n")
                try:
                    while True:
                        connection.sendall(b"x" * 65536)
                except OSError as error:
                    cut.append(error)

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        outcome = post(f"http://127.0.0.1:{server.getsockname()[1]}/", {}, "{}", LOOPBACK)
        thread.join()
    assert outcome.status_code == 500
    assert len(outcome.error) < 300
    assert cut


@pytest.mark.parametrize("value", ["", "5,x", "5,-1", "0"])
def test_the_retry_setting_is_checked(value):
    with pytest.raises(ValueError, match="webhook_retry_s"):
        Settings(webhook_retry_s=value)


def test_the_allow_setting_is_checked():
    with pytest.raises(ValueError, match="webhook_allow"):
        Settings(webhook_allow="10.0.0.0/8, 10.1.1.1/8")
    assert Settings(webhook_allow="10.0.0.0/8, fd00::/8").webhook_networks == (
        ip_network("10.0.0.0/8"), ip_network("fd00::/8")
    )  # fmt: skip
