"""Values that no honest client sends: each is refused by name, and none is a 500."""

import json

import pytest

from tests.conftest import CAMERA, track
from tests.service.conftest import problem

JSON = {"Content-Type": "application/json"}
HALF, NUL, HUGE = '"\\ud800"', '"a\\u0000b"', "1" + "0" * 400
T0 = 1_700_000_000


def post(http, url, text, **headers):
    return http.post(url, content=text.encode(), headers={**JSON, **headers})


def with_value(document, name, text):
    """The JSON of a document in which the text stands for the value of a name."""
    return json.dumps({**document, name: "@"}).replace('"@"', text)


@pytest.mark.parametrize("text", [HALF, NUL], ids=["half a pair", "NUL"])
def test_text_that_cannot_be_kept_is_refused_wherever_it_stands(corner, text):
    url = "/cameras/corner/tracks"
    whole = {"source": "s", "tracks": [track("good")]}
    problem(post(corner, url, with_value(whole, "source", text)), 422, "malformed")
    bad = with_value(track("x"), "id", text)
    good = json.dumps(track("good"))
    answer = post(corner, url, f'{{"tracks": [{bad}, {good}]}}')
    assert answer.status_code == 202
    assert answer.json()["accepted"] == 1
    assert answer.json()["rejected"][0]["code"] == "malformed"
    nd = {"Content-Type": "application/x-ndjson"}
    answer = post(corner, url, f"{bad}\n{json.dumps(track('other'))}\n", **nd)
    assert answer.json()["accepted"] == 1
    problem(post(corner, url + "?source=a%00b", good, **nd), 422, "malformed")
    for path, body, name in (
        ("/cameras", {**CAMERA, "id": "other"}, "name"),
        ("/cameras/corner/pose/accept", {}, "by"),
        ("/cameras/corner/reference/reset", {}, "by"),
        ("/cameras/corner/maintenance", {"to": "2099-01-01T00:00:00Z"}, "reason"),
        ("/alerts/none/resolve", {"outcome": "put_back"}, "note"),
        ("/alerts/none/silence", {"until": None}, "reason"),
        ("/webhooks", {"url": "https://example.org/"}, "name"),
        ("/ui/register", {"form": "angles"}, "name"),
    ):
        problem(post(corner, path, with_value(body, name, text)), 422, "malformed")
    # As a name of a field, it is in the answer.
    problem(post(corner, "/cameras", f"{{{text}: 1}}"), 422, "malformed")


@pytest.mark.parametrize("number", [HUGE, "-" + HUGE, "1e400", "NaN", "1e308", "9" * 5000])
def test_numbers_beyond_all_floats_are_refused(corner, number):
    url = "/cameras/corner/tracks"
    for name in ("started_at", "frame_rate_hz"):
        answer = post(corner, url, with_value({"tracks": [track("1")]}, name, number))
        problem(answer, 422, "malformed")
    point = f"[{T0}, {number}, 5]"
    answer = post(corner, url, f'{{"tracks": [{{"id": 1, "points": [{point}, {point}]}}]}}')
    assert answer.status_code in (202, 422)
    for field in ("fx", "cx", "width"):
        lens = with_value(CAMERA["intrinsics"], field, number)
        answer = post(corner, "/cameras", with_value({**CAMERA, "id": "n"}, "intrinsics", lens))
        assert answer.status_code in (400, 422)
    for field in ("height_m", "x_m", "heading_deg"):
        pose = with_value({**CAMERA["prior_pose"], "x_m": 0}, field, number)
        answer = post(corner, "/cameras", with_value({**CAMERA, "id": "n"}, "prior_pose", pose))
        assert answer.status_code in (400, 422)
    assert corner.get("/cameras/n").status_code == 404


def test_a_pose_given_in_halves_is_refused(corner):
    turned = {"rotation": [[1, 0, 0], [0, 0, -1], [0, 1, 0]], "translation_m": None}
    body = {**CAMERA, "id": "n", "prior_pose": turned}
    problem(corner.post("/cameras", json=body), 422, "malformed")


@pytest.mark.parametrize("moment", ["0001-01-01T00:00:00+14:00", "9999-12-31T23:59:59-14:00"])
def test_times_that_are_none_in_utc_are_refused(corner, moment):
    url = "/cameras/corner/pose/history"
    problem(corner.get(url, params={"from": moment}), 422, "malformed")
    problem(corner.get(url, params={"to": "2026-01-01T00:00:00"}), 422, "malformed")
    body = {"to": moment}
    problem(corner.post("/cameras/corner/maintenance", json=body), 422, "malformed")
    problem(corner.post("/alerts/none/silence", json={"until": moment}), 422, "malformed")


def test_ids_of_events_beyond_sqlite(corner):
    problem(corner.get("/events", params={"after": "9" * 30}), 422, "malformed")


@pytest.mark.parametrize("path", ["/cameras", "/cameras/corner/tracks", "/ui/preview", "/webhooks"])
def test_nests_are_refused(corner, path):
    for text in ("[" * 100_000, '{"a":' * 100_000):
        answer = post(corner, path, text)
        assert answer.status_code in (400, 422)
        problem(answer, answer.status_code, answer.json()["code"])


def test_an_answer_names_few_of_many_faults_and_none_at_length(corner):
    tracks = [["x" * 40] * 2000]
    answer = corner.post("/ui/preview", json={"fields": {}, "tracks": tracks})
    document = problem(answer, 422, "malformed")
    assert 1 <= len(document["errors"]) <= 20
    assert len(answer.content) < 20_000


def test_what_nobody_foresaw_is_a_problem_that_tells_nothing(corner, caplog, monkeypatch):
    def fail(*_):
        raise RuntimeError("a secret of the house")

    monkeypatch.setattr("service.cameras.cameras.view_camera", fail)
    answer = corner.get("/cameras/corner")
    document = problem(answer, 500, "internal")
    assert "secret" not in answer.text
    assert document["detail"] == "the service failed; its log says where"
    assert "a secret of the house" in caplog.text
    counted = corner.get("/metrics").text
    assert 'method="GET",route="/cameras/{camera_id}",status="500"' in counted
