"""Classes of posted JSON tracks: other objects than people are skipped and counted."""

import json

import pytest

from tests.conftest import track


def post(http, *tracks):
    return http.post("/cameras/corner/tracks", json={"source": "a", "tracks": list(tracks)})


@pytest.mark.parametrize(
    "named", ["person", "Pedestrian", " human ", 0, 0.0, "0", "0.0", -1, "", None]
)
def test_people_are_taken(corner, named):
    answer = post(corner, {**track("1"), "class": named})
    assert (answer.status_code, answer.json()) == (
        202, {"accepted": 1, "duplicates": 0, "rejected": []},
    )  # fmt: skip


@pytest.mark.parametrize("named", ["car", "bicycle", "Rider", "2", 2, 1])
def test_post_tracks_skips_and_counts_other_classes(corner, named):
    alone = post(corner, {**track("1"), "class": named})
    assert (alone.status_code, alone.json()["skipped"]) == (202, {"not_a_person": 1})
    assert f"(classes {named})" in alone.json()["detail"]
    beside = post(corner, {**track("2"), "class": named}, track("3")).json()
    assert (beside["accepted"], beside["skipped"]) == (1, {"not_a_person": 1})
    assert "detail" not in beside
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
    assert (answer["accepted"], answer["skipped"]) == (1, {"not_a_person": 1})


def test_query_names_the_classes_of_people_for_json_too(corner):
    tracks = [{**track(str(n)), "class": label} for n, label in enumerate((0, 3, "worker", "car"))]
    answer = corner.post("/cameras/corner/tracks?classes=3,worker", json={"tracks": tracks}).json()
    assert (answer["accepted"], answer["skipped"]) == (2, {"not_a_person": 2})


def test_body_of_which_all_is_rejected_or_skipped_counts_both(corner):
    short = {"id": "brief", "points": track("x")["points"][:2]}
    document = post(corner, short, {**track("1"), "class": "car"}).json()
    assert (document["status"], document["code"]) == (422, "nothing_taken")
    assert document["detail"].startswith(
        "tracks: none of 1 could be taken, 1 others were skipped, the first because: 2 points"
    )
