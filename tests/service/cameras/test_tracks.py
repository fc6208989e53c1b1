"""Tracks in all their forms, and bad input that loses nothing beside it."""

import json
import re
import time

import numpy as np
import pytest
from fastapi.testclient import TestClient
from sqlalchemy import select

from service.app import create_app
from service.settings import Settings
from service.store.engines.store import Store
from service.store.tracks import TrackRecord, unpack
from service.workers.upkeep.retention import limits_of_camera
from tests.conftest import CAMERA, track
from tests.service.conftest import problem

T0 = 1_700_000_000.0


def post(http, tracks, **fields):
    answer = http.post("/cameras/corner/tracks", json={"source": "t", "tracks": tracks, **fields})
    assert answer.status_code == 202, answer.text
    return answer.json()


def stored(settings: Settings) -> list[TrackRecord]:
    with Store(settings).read() as session:
        return list(session.scalars(select(TrackRecord).order_by(TrackRecord.id)))


def test_points_are_stored_as_posted(corner, settings):
    assert post(corner, [track("17")]) == {"accepted": 1, "duplicates": 0, "rejected": []}
    record = stored(settings)[0]
    assert (record.camera_id, record.source, record.track_id) == ("corner", "t", "17")
    np.testing.assert_array_equal(unpack(record.points, 3), track("17")["points"])
    assert record.boxes is None


def test_the_foot_of_a_box_is_the_middle_of_its_bottom_edge(corner, settings):
    boxes = [[T0 + n, 100.0 + n, 50.0, 140.0 + n, 200.0 + n] for n in range(6)]
    assert post(corner, [{"id": 3, "boxes": boxes}])["accepted"] == 1
    record = stored(settings)[0]
    assert record.track_id == "3"
    assert unpack(record.points, 3)[2].tolist() == [T0 + 2, 122.0, 202.0]
    assert unpack(record.boxes, 4)[2].tolist() == [102.0, 50.0, 142.0, 202.0]


def test_frames_become_times_by_rate_and_start(corner, settings):
    frames = [[n * 20, 100.0 + n, 200.0] for n in range(6)]
    answer = post(
        corner, [{"id": "f", "frames": frames}], frame_rate_hz=10, started_at="2023-11-14T22:13:20Z"
    )
    assert answer["accepted"] == 1
    np.testing.assert_allclose(unpack(stored(settings)[0].points, 3)[:, 0] - T0, 2.0 * np.arange(6))


def test_frame_boxes_use_the_cameras_own_rate(corner, settings):
    rows = [[n * 25, 100.0, 50.0, 140.0, 200.0] for n in range(6)]
    assert post(corner, [{"id": "f", "frame_boxes": rows}], started_at=T0)["accepted"] == 1
    np.testing.assert_allclose(unpack(stored(settings)[0].points, 3)[:, 0] - T0, np.arange(6))


def test_frames_without_a_start_are_refused_by_name(corner):
    answer = post(corner, [{"id": "f", "frames": [[n, 1.0, 1.0] for n in range(9)]}, track("ok")])
    assert answer["accepted"] == 1
    assert answer["rejected"][0]["code"] == "no_clock"


def test_ndjson_has_a_track_a_line(corner, settings):
    lines = "\n".join(json.dumps(track(str(n))) for n in range(3)) + "\n\n"
    answer = corner.post(
        "/cameras/corner/tracks?source=nd",
        content=lines,
        headers={"Content-Type": "application/x-ndjson"},
    )
    assert answer.json() == {"accepted": 3, "duplicates": 0, "rejected": []}
    assert {record.source for record in stored(settings)} == {"nd"}


# Bad input: the good are stored, the bad are named.


def refused(http, bad) -> dict:
    answer = post(http, [track("good"), bad, track("fine")])
    assert answer["accepted"] == 2
    (rejection,) = answer["rejected"]
    assert rejection["index"] == 1
    return rejection


@pytest.mark.parametrize("bad_id", [None, "", True, 1.5, "x" * 201])
def test_bad_id(corner, bad_id):
    rejection = refused(corner, {**track("x"), "id": bad_id})
    assert rejection["code"] == "malformed"
    assert rejection["detail"].startswith("id:")


def test_nan(corner):
    body = json.dumps({"tracks": [track("good"), {**track("bad")}, track("fine")]})
    body = body.replace("[1700000001.2, 336.0, 415.0]", "[1700000001.2, NaN, 415.0]")
    assert body.count("NaN") == 3
    body = json.loads(body)
    body["tracks"][0], body["tracks"][2] = track("good"), track("fine")
    answer = corner.post(
        "/cameras/corner/tracks",
        content=json.dumps(body),
        headers={"Content-Type": "application/json"},
    ).json()
    assert answer["accepted"] == 2
    assert answer["rejected"][0]["code"] == "not_finite"
    assert "points/3" in answer["rejected"][0]["detail"]


@pytest.mark.parametrize("value", [float("inf"), None, 10**400])
def test_other_numbers_that_are_none(corner, value):
    bad = track("bad")
    bad["points"][4][2] = value
    body = json.dumps({"tracks": [track("good"), bad]})
    answer = corner.post(
        "/cameras/corner/tracks", content=body, headers={"Content-Type": "application/json"}
    ).json()
    assert answer["accepted"] == 1
    assert answer["rejected"][0]["code"] == "not_finite"


def test_time_that_does_not_increase(corner):
    bad = track("bad")
    bad["points"][5][0] = bad["points"][4][0]
    rejection = refused(corner, bad)
    assert rejection["code"] == "time_not_increasing"
    assert "points/5/0" in rejection["detail"]


def test_milliseconds_are_no_seconds(corner):
    bad = track("bad", start_s=T0 * 1000)
    assert refused(corner, bad)["code"] == "time_out_of_range"


def test_a_track_from_the_future_cannot_own_the_window(corner, settings):
    rejection = refused(corner, track("ahead", start_s=time.time() + 3600))
    assert rejection["code"] == "time_out_of_range"
    assert "at most 60 s ahead of this service's clock" in rejection["detail"]
    ahead_s = float(re.search(r"this is ([\d.]+) s ahead", rejection["detail"])[1])
    assert ahead_s == pytest.approx(3600, abs=30)
    assert post(corner, [track("now", start_s=time.time() + 30)])["accepted"] == 1
    assert {record.track_id for record in stored(settings)} == {"good", "fine", "now"}


def test_what_is_taken_as_ahead_is_a_setting(settings):
    ahead = settings.model_copy(update={"max_ahead_s": 7200.0})
    with TestClient(create_app(ahead)) as http:
        http.post("/cameras", json=CAMERA).raise_for_status()
        assert post(http, [track("ahead", start_s=time.time() + 3600)])["accepted"] == 1


def test_a_recording_of_years_ago_outlives_retention(corner, settings):
    assert post(corner, [track("old", start_s=T0)])["accepted"] == 1
    with Store(settings).write() as session:
        assert next(limits_of_camera(settings, "corner")).bite(session) == 0
    assert len(stored(settings)) == 1


def test_a_body_of_which_nothing_was_taken_is_no_success(corner, settings):
    bad = [{"id": "a"}, {"id": "b", "points": [[T0, 1, 1], [T0 + 0.8, 2, 2]]}]
    answer = corner.post("/cameras/corner/tracks", json={"tracks": bad})
    document = problem(answer, 422, "nothing_taken")
    assert [error["pointer"] for error in document["errors"]] == ["/tracks/0", "/tracks/1"]
    assert document["errors"][1]["reason"].startswith("too_short: 2 points over 0.8 s")
    assert "none of 2" in document["detail"]
    assert post(corner, [])["accepted"] == 0  # there was nothing to take
    assert post(corner, [track("1"), *bad])["accepted"] == 1
    again = post(corner, [track("1"), *bad])
    assert (again["accepted"], again["duplicates"], len(again["rejected"])) == (0, 1, 2)


def test_too_short(corner):
    rejection = refused(corner, {"id": "24", "points": [[T0, 1, 1], [T0 + 0.8, 2, 2]]})
    assert rejection == {
        "index": 1,
        "id": "24",
        "code": "too_short",
        "detail": "2 points over 0.8 s; at least 5 points over 2 s are needed",
    }
    quick = {"id": "q", "points": [[T0 + 0.1 * n, 1, 1] for n in range(20)]}
    answer = post(corner, [track("another"), quick])
    assert answer["rejected"][0]["code"] == "too_short"


def test_five_points_over_two_seconds_are_enough(corner):
    edge = {"id": "edge", "points": [[T0 + 0.5 * n, 1, 1] for n in range(5)]}
    assert post(corner, [edge])["accepted"] == 1


def times(*time_s):
    return {"id": "t", "points": [[T0 + at, 1, 1] for at in time_s]}


def test_a_track_of_more_than_an_hour_is_nobodys_walk(corner):
    rejection = refused(corner, times(*range(-30 * 86_400, 1, 6 * 86_400)))
    assert rejection["code"] == "too_long"
    assert "at most 3600 s a track are taken, got 2592000.0 s" in rejection["detail"]
    assert post(corner, [times(*range(0, 3_601, 600))])["accepted"] == 1


def test_a_frame_rate_that_is_a_thousand_times_too_low_makes_a_track_too_long(corner):
    frames = {"id": "f", "frames": [[n, 1, 1] for n in range(6)]}
    answer = post(corner, [track("ok"), frames], frame_rate_hz=1e-6, started_at=T0 - 6e6)
    assert [each["code"] for each in answer["rejected"]] == ["too_long"]
    assert "frame_rate_hz" in answer["rejected"][0]["detail"]


def test_who_was_not_seen_for_ten_minutes_is_another(corner):
    rejection = refused(corner, times(0, 1, 2, 3, 604, 605))
    assert rejection["code"] == "gap"
    assert rejection["detail"].startswith("points/4/0: at most 600 s after the point before")
    assert "got 601.0 s" in rejection["detail"]


def test_too_many_points(corner):
    rejection = refused(corner, track("long", count=10_001) | {})
    assert rejection["code"] == "too_many_points"
    assert "10000" in rejection["detail"]
    assert "10001" in rejection["detail"]


def test_feet_absurdly_far_outside_the_image(corner):
    bad = track("bad")
    bad["points"][7][1] = 2561.0
    rejection = refused(corner, bad)
    assert rejection["code"] == "outside_image"
    assert "2560" in rejection["detail"]
    below = track("below")
    below["points"][7][2] = 800.0  # a foot below the picture is common
    assert post(corner, [below])["accepted"] == 1


def test_unknown_camera(corner):
    answer = corner.post("/cameras/nowhere/tracks", json={"tracks": [track("1")]})
    problem(answer, 404, "not_found")


def test_half_broken_batch(corner, settings):
    bad = [{"id": "a"}, "text", {"id": "b", "points": 7}, {"id": "c", "points": [[1, 2]]}]
    answer = post(corner, [track("1"), *bad, track("2")])
    assert answer["accepted"] == 2
    assert [(r["index"], r["id"], r["code"]) for r in answer["rejected"]] == [
        (1, "a", "malformed"),
        (2, None, "malformed"),
        (3, "b", "malformed"),
        (4, "c", "malformed"),
    ]
    assert [record.track_id for record in stored(settings)] == ["1", "2"]


def test_a_malformed_line_of_ndjson_is_named(corner):
    lines = f"{json.dumps(track('1'))}\n{{broken\n{json.dumps(track('2'))}"
    answer = corner.post(
        "/cameras/corner/tracks", content=lines, headers={"Content-Type": "application/x-ndjson"}
    ).json()
    assert answer["accepted"] == 2
    assert (answer["rejected"][0]["index"], answer["rejected"][0]["code"]) == (1, "malformed")


@pytest.mark.parametrize(
    "body", ["{", "[]", '{"tracks": 3}', "\xff", '{"source": 1, "tracks": []}']
)
def test_a_body_that_is_no_batch_is_refused_whole(corner, body):
    answer = corner.post(
        "/cameras/corner/tracks",
        content=body.encode("latin-1"),
        headers={"Content-Type": "application/json"},
    )
    assert problem(answer, 422, "malformed")["errors"][0]["reason"]


def test_too_many_tracks(corner, settings):
    answer = corner.post("/cameras/corner/tracks", json={"tracks": [{}] * 5001})
    document = problem(answer, 413, "too_large")
    assert "5000" in document["detail"]
    assert "5001" in document["detail"]
    assert stored(settings) == []


def test_too_large_a_body(corner):
    answer = corner.post(
        "/cameras/corner/tracks",
        content=b" " * (32 * 1024 * 1024 + 1),
        headers={"Content-Type": "application/json"},
    )
    assert "33554432" in problem(answer, 413, "too_large")["detail"]


def test_another_media_type(corner):
    answer = corner.post(
        "/cameras/corner/tracks", content="x", headers={"Content-Type": "text/html"}
    )
    problem(answer, 415, "unsupported_media_type")


def test_the_same_batch_twice_changes_nothing(corner, settings):
    batch = [track("1"), track("2"), {"id": "bad"}]
    assert post(corner, batch)["accepted"] == 2
    before = [(r.id, r.received_at) for r in stored(settings)]
    again = post(corner, batch)
    assert (again["accepted"], again["duplicates"], len(again["rejected"])) == (0, 2, 1)
    assert [(r.id, r.received_at) for r in stored(settings)] == before


def test_a_number_used_again_later_is_another_track(corner):
    assert post(corner, [track("1")])["accepted"] == 1
    assert post(corner, [track("1", start_s=T0 + 3600)])["accepted"] == 1
