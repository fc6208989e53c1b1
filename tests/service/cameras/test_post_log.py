"""The memory of posts: what it counts, and that it stays as small as it says."""

import sys

from service.cameras import post_log
from service.cameras.post_log import PostLog
from service.cameras.tracks import Receipt
from service.errors import MalformedError
from service.formats.track import Rejection
from tests.conftest import track


def receipt(*rejections):
    return Receipt(
        source="a", accepted=1, duplicates=0, rejections=rejections, skipped={},
        other_classes=(), detail=None, ignored=(),
    )  # fmt: skip


def rejection(index, code="too_short"):
    return Rejection(index=index, track_id=f"t{index}", code=code, detail="x" * 5_000)


def test_of_a_flood_of_refusals_all_are_counted_and_the_newest_kept(monkeypatch):
    monkeypatch.setattr(post_log, "_MOST_CAMERAS", 3)
    log = PostLog()
    for camera in range(50):
        for _ in range(3):
            log.note(f"cam-{camera}", receipt(*map(rejection, range(5_000))))
    assert [bool(log.of(f"cam-{n}").last_at) for n in (0, 46, 47, 49)] == [False, False, True, True]
    posts = log.of("cam-49")
    assert (posts.accepted, posts.refused["too_short"]) == (3, 15_000)
    assert [each.what for each in posts.newest] == [f"t{n}" for n in range(4999, 4979, -1)]
    assert max(sys.getsizeof(each.detail) for each in posts.newest) < 400


def test_who_posted_last_is_not_forgotten_for_who_is_silent(monkeypatch):
    monkeypatch.setattr(post_log, "_MOST_CAMERAS", 2)
    log = PostLog()
    for camera_id in ("a", "b", "a", "c"):
        log.note(camera_id, receipt())
    assert (log.of("a").accepted, log.of("b").accepted, log.of("c").accepted) == (2, 0, 1)


def test_a_post_that_is_refused_as_a_whole_is_one_refusal():
    log = PostLog()
    log.note_error("corner", MalformedError.of_field("tracks", "a list of tracks is needed"))
    (refusal,) = log.of("corner").newest
    assert (refusal.what, refusal.code) == ("the whole post", "malformed")
    assert refusal.detail == "/tracks a list of tracks is needed"


def test_posts_are_noted_with_what_became_of_their_tracks(corner):
    posts = corner.app_state["app"].posts
    short = {"id": "brief", "points": track("x")["points"][:2]}
    url = "/cameras/corner/tracks"
    corner.post(url, json={"tracks": [track("1"), short]})
    corner.post(url, json={"tracks": [track("1")]})
    corner.post(url, json={"tracks": [short, {**short, "id": "too"}]})  # nothing to be taken
    corner.post(url, content=b"PNG", headers={"Content-Type": "image/png"})
    corner.post("/cameras/nowhere/tracks", json={"tracks": [track("1")]})
    known = posts.of("corner")
    assert (known.accepted, known.duplicates) == (1, 1)
    assert dict(known.refused) == {"too_short": 3, "unsupported_media_type": 1}
    assert [each.what for each in known.newest] == [
        "the whole post", "/tracks/1", "/tracks/0", "brief",
    ]  # fmt: skip
    assert posts.of("nowhere").last_at is None
    corner.delete("/cameras/corner", headers={"If-Match": "*"}).raise_for_status()
    assert posts.of("corner").newest == posts.of("nowhere").newest  # another may come by its id


def test_skipped_tracks_are_counted_and_each_reason_is_logged_once(corner, caplog):
    caplog.set_level("INFO", "surefoot.tracks")
    url, car = "/cameras/corner/tracks", {**track("1"), "class": "car"}
    short = {"id": "brief", "points": track("x")["points"][:2]}
    for tracks in ([car], [car, track("2")], [car, short], [{**track("3"), "confidence": 0}]):
        corner.post(url, json={"source": "a", "tracks": tracks})
    posts = corner.app_state["app"].posts.of("corner")
    assert dict(posts.skipped) == {"not_a_person": 3, "ignored_by_confidence": 1}
    logged = [(record.reason, record.tracks) for record in caplog.records]
    assert logged == [("not_a_person", 1), ("ignored_by_confidence", 1)]
    page = corner.get("/ui/cameras/corner/posts").text
    assert "3 tracks skipped: not a person" in page
