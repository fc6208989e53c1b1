"""What a process knows of a camera's pictures, which another one changes or removes."""

import numpy as np
import pytest
from fastapi.testclient import TestClient
from sqlalchemy import select

from service.app import create_app
from service.store.engines.store import Store
from service.store.tracks import TrackRecord, unpack
from tests.conftest import CAMERA, track
from tests.service.conftest import problem

T0 = 1_700_000_000.0
LENS = CAMERA["intrinsics"]
FRAMES = [[n * 50, 100.0 + n, 200.0] for n in range(6)]


@pytest.fixture
def other(corner, settings):
    """Another process over the same store, once the first has been posted to."""
    assert post(corner, track("known")).status_code == 202
    with TestClient(create_app(settings)) as http:
        yield http


def post(http, *tracks, **fields):
    return http.post("/cameras/corner/tracks", json={"tracks": tracks, **fields})


def change(http, **fields):
    etag = http.get("/cameras/corner").headers["ETag"]
    answer = http.patch("/cameras/corner", json=fields, headers={"If-Match": etag})
    assert answer.status_code == 200, answer.text


def times(settings, track_id):
    with Store(settings).read() as session:
        query = select(TrackRecord.points).where(TrackRecord.track_id == track_id)
        return unpack(session.scalars(query).one(), 3)[:, 0]


def test_frames_are_by_the_rate_that_another_process_has_set(corner, other, settings):
    change(other, frame_rate_hz=50.0)  # it was 25
    answer = post(corner, {"id": "f", "frames": FRAMES}, started_at=T0)
    assert answer.status_code == 202
    np.testing.assert_allclose(times(settings, "f") - T0, np.arange(6))


def test_feet_are_held_against_the_size_that_another_process_has_set(corner, other):
    far = track("far")
    far["points"][7][1] = 2561.0  # twice the width is the most
    assert problem(post(corner, far), 422, "nothing_taken")
    wide = {**LENS, "width": 2 * LENS["width"], "cx": 2 * LENS["cx"]}
    change(other, intrinsics=wide)
    assert post(corner, far).status_code == 202
    change(other, intrinsics=LENS)
    far["id"] = "farther"
    problem(post(corner, far), 422, "nothing_taken")


def test_a_camera_that_another_process_has_removed_is_none(corner, other):
    etag = other.get("/cameras/corner").headers["ETag"]
    assert other.delete("/cameras/corner", headers={"If-Match": etag}).status_code == 204
    for _ in range(2):
        problem(post(corner, track("1")), 404, "not_found")
        problem(post(corner, "no track at all", surprise=1), 404, "not_found")
    assert other.post("/cameras", json=CAMERA).status_code == 201
    assert post(corner, track("1")).status_code == 202
