"""A class that a tracker gives: who is no person is left out, counted, and in nobody's way."""

import json

import pytest

from tests.conftest import track


def post(http, *tracks):
    return http.post("/cameras/corner/tracks", json={"source": "a", "tracks": list(tracks)})


@pytest.mark.parametrize("named", ["person", "Pedestrian", " human ", 0, 0.0, None])
def test_people_are_taken(corner, named):
    answer = post(corner, {**track("1"), "class": named})
    assert (answer.status_code, answer.json()) == (
        202, {"accepted": 1, "duplicates": 0, "rejected": []},
    )  # fmt: skip


@pytest.mark.parametrize("named", ["car", "bicycle", "", 2, 1])
def test_others_are_left_out_and_counted(corner, named):
    alone = post(corner, {**track("1"), "class": named})
    assert (alone.status_code, alone.json()["left_out"]) == (202, 1)
    beside = post(corner, {**track("2"), "class": named}, track("3")).json()
    assert (beside["accepted"], beside["left_out"]) == (1, 1)
    assert corner.get("/cameras/corner").json()["tracks"] == 1


@pytest.mark.parametrize("named", [True, [], {"name": "person"}])
def test_what_is_no_class_is_refused_by_name(corner, named):
    answer = post(corner, {**track("1"), "class": named}, track("2")).json()
    (refused,) = answer["rejected"]
    assert (refused["id"], refused["code"]) == ("1", "malformed")
    assert refused["detail"].startswith("class: text or a number is needed, got ")
    assert answer["accepted"] == 1


def test_lines_of_json_have_classes_too(corner):
    lines = [{**track("1"), "class": "car"}, {**track("2"), "class": "person"}]
    answer = corner.post(
        "/cameras/corner/tracks",
        content="\n".join(map(json.dumps, lines)),
        headers={"Content-Type": "application/x-ndjson"},
    ).json()
    assert (answer["accepted"], answer["left_out"]) == (1, 1)
