"""Who is looked at before others: what may have moved, and what somebody watches."""

from sqlalchemy import text

from service.store import estimates
from tests.conftest import CAMERA, track
from tests.service.bench import moved
from tests.stores.queued import queued_cameras


def in_turn(bench):
    with bench.store.read() as session:
        return queued_cameras(session)


def post_to(http, camera_id):
    body = {"tracks": [track("late")]}
    http.post(f"/cameras/{camera_id}/tracks", json=body).raise_for_status()


def test_a_camera_that_may_have_moved_has_its_turn_before_others(bench):
    bench.see(moved())
    bench.see(moved(tilt_deg=4))
    bench.http.post("/cameras", json={**CAMERA, "id": "still"}).raise_for_status()
    with bench.store.write() as session:
        session.execute(text("DELETE FROM workflow_status"))
        session.execute(text("UPDATE cameras SET estimate_due_at = NULL"))
    post_to(bench.http, "still")
    post_to(bench.http, "corner")
    assert in_turn(bench) == ["corner", "still"]


def test_one_that_is_back_waits_like_others(bench):
    for pose in (moved(), moved(tilt_deg=4), moved(), moved()):
        bench.see(pose)
    with bench.store.read() as session:
        assert not estimates.newest(session, "corner").suspects_move


def test_a_camera_whose_page_is_looked_at_has_its_turn_before_others(corner, bench):
    for camera_id in ("other", "watched"):
        corner.post("/cameras", json={**CAMERA, "id": camera_id}).raise_for_status()
    corner.get("/ui/cameras/watched").raise_for_status()
    with bench.store.write() as session:
        session.execute(text("DELETE FROM workflow_status"))
        session.execute(text("UPDATE cameras SET estimate_due_at = NULL"))
    post_to(corner, "other")
    post_to(corner, "watched")
    assert in_turn(bench) == ["watched", "other"]
