"""More than can be done: who is refused is told so at once, and all is well right after."""

import asyncio
import sqlite3
import threading
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager

import httpx
import pytest
from fastapi.testclient import TestClient

from service.api.middleware.admission import Lane
from service.app import create_app
from service.errors import OverloadedError
from service.store.engines.sqlite import Turns
from service.store.engines.store import Store
from tests.conftest import CAMERA, track
from tests.running import RunningService, free_port, wait_for
from tests.service.conftest import problem


@contextmanager
def client_of(settings, **changes):
    with TestClient(create_app(settings.model_copy(update=changes))) as client:
        assert client.post("/cameras", json=CAMERA).status_code == 201
        yield client


@contextmanager
def somebody_writing(settings):
    """Another process that keeps the write lock; on a server, another connection."""
    if settings.database_url is None:
        # Foreign: it knows nothing of the turns that our own writers take.
        with closing(sqlite3.connect(settings.database_path, isolation_level=None)) as other:
            other.execute("BEGIN IMMEDIATE")
            yield
            other.execute("ROLLBACK")
        return
    store = Store(settings)
    with store.write() as session:
        yield
        session.rollback()
    store.close()


def test_a_request_has_one_connection_at_a_time(settings):
    """As many posts at once as there are connections leave none waiting for a second one."""
    with client_of(settings, http_at_once=1, http_wait_s=2.0) as client:
        store = client.app_state["app"].store
        held = [store.engine.connect() for _ in range(store.connections - 1)]
        answer = client.post("/cameras/corner/tracks", json={"tracks": [track("1")]})
        assert answer.status_code == 202
        for connection in held:
            connection.close()


def test_no_connection_in_time_is_told_so(settings):
    with client_of(settings, http_at_once=1, http_wait_s=0.2) as client:
        store = client.app_state["app"].store
        held = [store.engine.connect() for _ in range(store.connections)]
        answer = client.post("/cameras/corner/tracks", json={"tracks": [track("1")]})
        problem(answer, 503, "overloaded")
        assert int(answer.headers["retry-after"]) >= 1
        assert client.get("/healthz").status_code == 200
        for connection in held:
            connection.close()
        assert client.get("/cameras/corner").status_code == 200


def test_who_cannot_write_in_time_is_told_so_and_reads_go_on(settings):
    with client_of(settings, http_wait_s=1.0, http_at_once=4) as client:
        with somebody_writing(settings), ThreadPoolExecutor(12) as pool:
            posts = [
                pool.submit(client.post, "/cameras/corner/tracks", json={"tracks": [track(str(n))]})
                for n in range(12)
            ]
            assert client.get("/cameras/corner").status_code == 200
            assert client.get("/healthz").status_code == 200
            assert client.get("/metrics").status_code == 200
            document = client.get("/readyz")
            assert document.status_code == 503
            assert document.json()["problems"][0].startswith("store: ")
            for post in posts:
                problem(post.result(), 503, "overloaded")
                assert int(post.result().headers["retry-after"]) >= 1
        answer = client.post("/cameras/corner/tracks", json={"tracks": [track("after")]})
        assert answer.status_code == 202
        assert client.get("/cameras/corner").json()["tracks"] == 1
        counted = client.get("/metrics").text
        assert 'surefoot_http_refusals_total{code="overloaded"} 12.0' in counted


def test_turns_come_in_the_order_of_asking_and_are_handed_on():
    turns, order, begun = Turns("write"), [], []

    def take(n):
        begun.append(n)
        with turns.turn(10):
            order.append(n)

    with turns.turn(1):
        threads = []
        for n in range(8):
            thread = threading.Thread(target=take, args=(n,))
            thread.start()
            threads.append(thread)
            wait_for(lambda n=n: turns.waiting == n + 1, 5, 0.001)
        with pytest.raises(OverloadedError, match="write: others were at it for 0.01 s"):
            turns._take(0.01)
    for thread in threads:
        thread.join()
    assert order == list(range(8))
    with turns.turn(0):
        pass


def test_a_lane_refuses_at_once_what_it_has_no_place_for():
    async def run():
        lane = Lane("writes", at_once=1, waiting=1, patience_s=0.05)
        async with lane.turn():
            waiter = asyncio.create_task(lane.turn().__aenter__())
            await asyncio.sleep(0)
            with pytest.raises(OverloadedError, match="and 1 requests wait"):
                lane.check()
            with pytest.raises(OverloadedError, match="no turn came within"):
                await waiter
            gone = asyncio.create_task(lane.turn().__aenter__())
            await asyncio.sleep(0)
            gone.cancel()
            await asyncio.gather(gone, return_exceptions=True)
        for _ in range(3):  # no turn was lost with those who gave up
            async with lane.turn():
                pass

    asyncio.run(run())


def test_a_writer_that_fails_gives_its_turn_back(settings):
    store = Store(settings, patience_s=0.1)

    def fail():
        with store.write():
            raise ZeroDivisionError

    for _ in range(3):
        with pytest.raises(ZeroDivisionError):
            fail()
    with store.write():
        pass


@pytest.mark.slow
def test_forty_clients_get_answers_and_health_throughout(settings):
    """What wedged the API for minutes: 40 clients that post as fast as they are answered."""
    changed = {"port": free_port(), "workers": 0, "http_waiting": 8}
    free = {"camera_rate": 0.0, "caller_rate": 0.0}
    running = RunningService(settings.model_copy(update={**changed, **free}))
    running.start()
    try:
        for n in range(4):
            running.http.post("/cameras", json={**CAMERA, "id": f"c{n}"}).raise_for_status()
        ended, counts = threading.Event(), Counter()

        def post(client):
            with httpx.Client(base_url=running.url, timeout=30) as http:
                for n in range(10_000):
                    if ended.is_set():
                        return
                    body = {"source": str(client), "tracks": [track(str(n))]}
                    answer = http.post(f"/cameras/c{client % 4}/tracks", json=body)
                    counts[answer.status_code] += 1
                    if answer.status_code != 202:
                        problem(answer, 503, "overloaded")
                        assert int(answer.headers["retry-after"]) >= 1

        with ThreadPoolExecutor(40) as pool:
            done = [pool.submit(post, client) for client in range(40)]
            try:
                for _ in range(6):
                    assert running.http.get("/healthz").status_code == 200
                    assert running.http.get("/readyz").json()["store_writable"]
                    assert running.http.get("/metrics").status_code == 200
                    ended.wait(0.2)
            finally:
                ended.set()
        for item in done:
            item.result()
        assert set(counts) <= {202, 503}
        assert counts[202] > 40
        kept = sum(running.http.get(f"/cameras/c{n}").json()["tracks"] for n in range(4))
        assert kept == counts[202]
    finally:
        running.stop()
