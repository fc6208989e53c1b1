"""Limits that say when to come back: rates, cameras, bytes of a camera."""

from contextlib import contextmanager

import httpx
import numpy as np
import pytest
from fastapi.testclient import TestClient
from sqlalchemy import text

from models.tracks.scenes import SceneTrack
from models.tracks.trajectory import Trajectory
from service.api.middleware.rate_limits import Buckets
from service.app import create_app
from service.commands.replay import post_tracks
from service.errors import TooManyRequestsError
from service.store.engines.store import Store
from tests.conftest import CAMERA, track
from tests.service.conftest import problem

URL = "/cameras/corner/tracks"


@contextmanager
def client_of(settings, **changes):
    with TestClient(create_app(settings.model_copy(update=changes))) as client:
        assert client.post("/cameras", json=CAMERA).status_code == 201
        yield client


class Clock:
    """A clock that stands but when somebody sleeps by it."""

    def __init__(self):
        self.now_s = 1000.0

    def monotonic(self):
        return self.now_s

    def sleep(self, seconds):
        self.now_s += seconds


@pytest.fixture
def clock(monkeypatch):
    """The clock of the rates, and of a replay that waits for them."""
    clock = Clock()
    monkeypatch.setattr("service.api.middleware.rate_limits.time", clock)
    monkeypatch.setattr("service.commands.replay.time", clock)
    return clock


@pytest.mark.usefixtures("clock")
def test_a_camera_is_told_of_so_often(settings):
    with client_of(settings, camera_rate=0.1) as client:
        assert client.post(URL, json={"tracks": [track("1")]}).status_code == 202
        answer = client.post(URL, json={"tracks": [track("2")]})
        problem(answer, 429, "too_many_requests")
        assert answer.headers["retry-after"] == "10"
        # The router would take a path that ends a line for the same one.
        ended = client.post(f"{URL}%0a", json={"tracks": [track("2")]})
        problem(ended, 404, "not_found")
        # Others, and reads of the same one, are free.
        problem(client.post("/cameras/other/tracks", json={"tracks": []}), 404, "not_found")
        assert client.get("/cameras/corner").json()["tracks"] == 1
        counted = client.get("/metrics").text
        assert 'surefoot_http_refusals_total{code="too_many_requests"} 1.0' in counted


def test_a_replay_comes_back_when_it_is_told_to(settings, clock):
    points = np.array(track("1")["points"])
    walk = Trajectory(time_s=points[:, 0], uv=points[:, 1:])
    with client_of(settings, camera_rate=1.0) as client:
        for n in range(6):  # five at once, and the sixth after a second
            seen = [SceneTrack(track_id=str(n), trajectory=walk)]
            assert post_tracks(client, "corner", seen, 0.0)["accepted"] == 1
        assert clock.now_s == 1001.0
        counted = client.get("/metrics").text
        assert 'surefoot_http_refusals_total{code="too_many_requests"} 1.0' in counted


@pytest.mark.usefixtures("clock")
def test_a_caller_asks_so_often_but_health_is_free(settings):
    with client_of(settings, caller_rate=0.4) as client:
        assert client.get("/cameras").status_code == 200
        problem(client.get("/cameras"), 429, "too_many_requests")
        assert client.get("/healthz").status_code == 200
        assert client.get("/readyz").json()["store_writable"]


def test_a_bucket_fills_again_and_the_quiet_are_forgotten(clock, monkeypatch):
    monkeypatch.setattr("service.api.middleware.rate_limits._MOST_KEYS", 3)
    buckets = Buckets("rate", 2.0)
    for _ in range(10):
        buckets.take("a")
    with pytest.raises(TooManyRequestsError) as refused:
        buckets.take("a")
    assert refused.value.retry_after_s == pytest.approx(0.5)
    clock.sleep(0.5)
    buckets.take("a")
    with pytest.raises(TooManyRequestsError):
        buckets.take("a")
    for key in "bcde":
        buckets.take(key)
    assert list(buckets._levels) == ["c", "d", "e"]


def test_so_many_cameras(settings):
    with client_of(settings, max_cameras=2) as client:
        assert client.post("/cameras", json={**CAMERA, "id": "b"}).status_code == 201
        answer = client.post("/cameras", json={**CAMERA, "id": "c"})
        assert "SUREFOOT_MAX_CAMERAS" in problem(answer, 409, "too_many_cameras")["detail"]
        client.delete("/cameras/b", headers={"If-Match": "*"})
        assert client.post("/cameras", json={**CAMERA, "id": "c"}).status_code == 201


@pytest.mark.parametrize(
    ("status", "headers"),
    [(502, {}), (503, {"retry-after": "Fri, 27 Nov 2026 21:00:00 GMT"})],
)
def test_a_replay_tells_what_a_proxy_answers(status, headers):
    def proxy(_):
        return httpx.Response(status, text="<html>busy</html>", headers=headers)

    points = np.array(track("1")["points"])
    walk = Trajectory(time_s=points[:, 0], uv=points[:, 1:])
    seen = [SceneTrack(track_id="1", trajectory=walk)]
    with (
        httpx.Client(base_url="http://surefoot", transport=httpx.MockTransport(proxy)) as http,
        pytest.raises(httpx.HTTPStatusError, match=str(status)),
    ):
        post_tracks(http, "corner", seen, 0.0)


def test_a_camera_has_its_bytes(settings, monkeypatch):
    """A track of 20 points has 480 bytes: 0.02 MB are kept, and half more until some go."""
    with client_of(settings, keep_mb=0.02) as client:
        taken = 0
        for n in range(10):
            batch = [track(f"{n}-{k}") for k in range(10)]
            answer = client.post(URL, json={"tracks": batch})
            if answer.status_code != 202:
                break
            taken += 10
        document = problem(answer, 429, "quota_exceeded")
        assert "SUREFOOT_KEEP_MB" in document["detail"]
        assert int(answer.headers["retry-after"]) >= 60
        assert 0.02 * 1e6 <= taken * 480 <= 0.03 * 1e6
        assert client.get("/cameras/corner").json()["tracks"] == taken
        # Retention makes room; the count is taken anew.
        with Store(settings).write() as session:
            session.execute(text("DELETE FROM tracks"))
        monkeypatch.setattr("service.cameras.tracks._RECOUNT_S", 0.0)
        assert client.post(URL, json={"tracks": batch}).status_code == 202


def test_zero_bytes_are_any(settings):
    with client_of(settings, keep_mb=0) as client:
        assert client.post(URL, json={"tracks": [track("1")]}).status_code == 202


def test_two_sources_within_their_limits_are_refused_nothing(settings, monkeypatch):
    """Each has 16.8 kB of 20: together more than half again of what one may have."""
    monkeypatch.setattr("service.cameras.tracks._RECOUNT_S", 0.0)
    with client_of(settings, keep_mb=0.02) as client:
        for source in ("a", "b"):
            for n in range(35):
                body = {"source": source, "tracks": [track(f"{source}{n}")]}
                assert client.post(URL, json=body).status_code == 202
        assert client.post(URL, json={"source": "a", "tracks": [track("a35")]}).status_code == 202


def test_a_source_that_floods_has_no_tracks_of_the_other_refused(settings, monkeypatch):
    monkeypatch.setattr("service.cameras.tracks._RECOUNT_S", 0.0)
    with client_of(settings, keep_mb=0.02) as client:

        def post(source, n):
            body = {"source": source, "tracks": [track(f"{source}{n}")]}
            return client.post(URL, json=body)

        assert post("counts", 0).status_code == 202
        flood = [post("flood", n).status_code for n in range(80)]
        assert set(flood) == {202, 429}
        assert post("counts", 1).status_code == 202  # with a count that is taken anew
        monkeypatch.setattr("service.cameras.tracks._RECOUNT_S", 3600.0)
        assert post("counts", 2).status_code == 202
        problem(post("flood", 80), 429, "quota_exceeded")
