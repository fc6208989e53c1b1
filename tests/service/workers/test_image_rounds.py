"""Cameras that do not answer delay the images of those that do by little."""

import socket
import threading
import time
from contextlib import ExitStack, closing
from datetime import UTC, datetime, timedelta

import pytest

from service.job_queue import JobQueue
from service.notifications import fetch
from service.store.cameras import CameraRecord
from service.store.engines.store import Store
from service.workers.context import JobContext
from service.workers.upkeep.snapshots import SnapshotRounds
from tests.conftest import CAMERA
from tests.running import wait_for

SILENT = 40


@pytest.fixture
def context(http, settings, monkeypatch):
    monkeypatch.setitem(fetch._TIMEOUTS_S, "read", 1.0)  # of 5 s
    allowed = {"snapshots": "features", "snapshot_allow": "127.0.0.0/8"}
    with closing(Store(settings)) as store:
        yield JobContext(
            settings=settings.model_copy(update=allowed),
            store=store,
            queue=JobQueue(store.engine),
        )


@pytest.fixture
def hosts():
    """Makes hosts that accept connections and never answer."""
    with ExitStack() as stack:
        yield lambda: stack.enter_context(closing(socket.create_server(("127.0.0.1", 0))))


def register(http, camera_id, listening, path="now.jpg"):
    url = f"http://127.0.0.1:{listening.getsockname()[1]}/{path}"
    http.post("/cameras", json={**CAMERA, "id": camera_id, "snapshot_url": url}).raise_for_status()


def asked_after(rounds, context, live, timeout_s):
    """Seconds until a host is connected to, while rounds go on."""
    done = threading.Event()

    def go_on():
        while not done.wait(0.1):
            rounds.run(context)

    thread = threading.Thread(target=go_on)
    begun_s = time.monotonic()
    thread.start()
    live.settimeout(timeout_s)
    try:
        live.accept()[0].close()
        return time.monotonic() - begun_s
    finally:
        done.set()
        thread.join()
        rounds._threads.shutdown()


def test_new_camera_beside_forty_silent_ones_is_asked_soon(http, context, hosts):
    """It was asked after 154 s: four at a time, 15 s each."""
    for number in range(SILENT):
        register(http, f"silent-{number:02}", hosts())
    live = hosts()
    register(http, "z-live", live)
    assert asked_after(SnapshotRounds(), context, live, 20) < 5  # two waits of 1 s


def test_camera_that_answers_is_asked_at_once_beside_silent_ones(http, context, hosts):
    for number in range(SILENT):
        register(http, f"silent-{number:02}", hosts())
    live = hosts()
    register(http, "z-live", live)
    with context.store.write() as session:
        session.get_one(CameraRecord, "z-live").snapshot_due_at = datetime.now(UTC)
    assert asked_after(SnapshotRounds(), context, live, 20) < 0.9


def test_silent_recorder_is_asked_by_few_and_then_left_alone(http, context, hosts):
    """A hundred cameras of one host wait for it four at a time, once."""
    recorder = hosts()
    for number in range(20):
        register(http, f"channel-{number:02}", recorder, f"{number}.jpg")
    rounds = SnapshotRounds()
    rounds.run(context)
    assert len(rounds._under_way) == 4
    wait_for(lambda: not rounds._under_way, 10, 0.05)
    rounds.run(context)
    wait_for(lambda: not rounds._under_way, 1, 0.05)
    with context.store.read() as session:
        found = [session.get_one(CameraRecord, f"channel-{number:02}") for number in range(20)]
        errors = [each.snapshot_error or "" for each in found]
        left = [each.snapshot_due_at for each in found]
    assert [error[:14] for error in errors[:4]] == ["no whole image"] * 4
    assert all("did not answer; the next request is in" in error for error in errors[4:8])
    now = datetime.now(UTC)
    assert all(at - now > timedelta(minutes=9) for at in left[:4])
    assert all(at - now < timedelta(seconds=3) for at in left[4:8])
