"""Numbers of another picture than the camera's own: a detector's stream, or shares of it."""

import json

import numpy as np
import pytest
from sqlalchemy import select

from service.formats import json_body
from service.store.engines.store import Store
from service.store.tracks import TrackRecord, unpack
from tests.service.conftest import problem

T0 = 1_700_000_000.0
URL = "/cameras/corner/tracks"
# The camera's picture is 1280 x 720; the first pixel's centre is 0 in every picture.
IN_PICTURE = [99.5, 71.5, 199.5, 359.5]
IN_640 = [49.5, 35.5, 99.5, 179.5]
SHARES = [100 / 1280, 0.1, 200 / 1280, 0.5]


def rows(box, form="boxes"):
    numbers = box if form == "boxes" else [(box[0] + box[2]) / 2, box[3]]
    return [[T0 + n * 0.5, *numbers] for n in range(6)]


def stored(settings):
    with Store(settings).read() as session:
        (record,) = session.scalars(select(TrackRecord))
        boxes = None if record.boxes is None else unpack(record.boxes, 4)
        return unpack(record.points, 3), boxes


def holds(settings, form="boxes"):
    points, boxes = stored(settings)
    np.testing.assert_allclose(points[0, 1:], [149.5, 359.5], atol=1e-9)
    if form == "boxes":
        np.testing.assert_allclose(boxes[0], IN_PICTURE, atol=1e-9)


@pytest.mark.parametrize("form", ["points", "boxes"])
@pytest.mark.parametrize("within", ["body", "track"])
@pytest.mark.parametrize(
    ("box", "says"),
    [
        (IN_PICTURE, {}),
        (IN_PICTURE, {"size": None, "normalised": False}),
        (IN_640, {"size": [640, 360]}),
        (SHARES, {"normalised": True}),
        (SHARES, {"normalised": True, "size": [640, 360]}),
    ],
)
def test_json_is_scaled_to_the_cameras_own_picture(corner, settings, form, within, box, says):
    track = {"id": "1", form: rows(box, form)}
    body = {"tracks": [track | says]} if within == "track" else {"tracks": [track], **says}
    assert corner.post(URL, json=body).json()["accepted"] == 1
    holds(settings, form)


def test_heads_are_scaled_too(corner, settings):
    points = [[T0 + n * 0.5, 0.5, 0.5, 0.5, 0.25] for n in range(6)]
    body = {"normalised": True, "tracks": [{"id": "1", "points": points}]}
    assert corner.post(URL, json=body).status_code == 202
    with Store(settings).read() as session:
        (record,) = session.scalars(select(TrackRecord))
        assert unpack(record.heads, 2)[0].tolist() == [639.5, 179.5]


@pytest.mark.parametrize(
    ("box", "query"),
    [(IN_640, {"size": "640,360"}), (SHARES, {"normalised": "true"})],
)
def test_a_query_says_it_of_lines(corner, settings, box, query):
    lines = json.dumps({"id": "1", "boxes": rows(box)})
    headers = {"Content-Type": "application/x-ndjson"}
    assert corner.post(URL, params=query, content=lines, headers=headers).status_code == 202
    holds(settings)


@pytest.mark.parametrize(
    ("box", "first", "query"),
    [(IN_640, 1, {"size": "640,360"}), (SHARES, 0, {"normalised": "true"})],
)
def test_a_query_says_it_of_motchallenge_text(corner, settings, box, first, query):
    left, top, right, bottom = box
    cells = f"{left + first!r},{top + first!r},{right - left!r},{bottom - top!r}"
    text = "\n".join(f"{n + 1},1,{cells},0.9,0,-1" for n in range(6))
    params = {"frame_rate_hz": 2, "started_at": "2023-11-14T22:13:20Z", **query}
    answer = corner.post(URL, params=params, content=text, headers={"Content-Type": "text/csv"})
    assert answer.json()["accepted"] == 1
    holds(settings)


@pytest.mark.parametrize(
    ("says", "field"),
    [
        ({"size": [640]}, "size"),
        ({"size": [640, 0]}, "size"),
        ({"size": [640, True]}, "size"),
        ({"size": "640x360"}, "size"),
        ({"size": [10**400, 1]}, "size"),
        ({"normalised": "yes"}, "normalised"),
        ({"normalised": 1}, "normalised"),
    ],
)
def test_what_is_no_size_is_refused_by_name(corner, says, field):
    track = {"id": "1", "boxes": rows(IN_640)}
    document = problem(corner.post(URL, json={"tracks": [track], **says}), 422, "malformed")
    assert document["errors"][0]["pointer"] == f"/{field}"
    answer = corner.post(URL, json={"tracks": [track | says, {"id": "2", "boxes": rows(IN_640)}]})
    (refused,) = answer.json()["rejected"]
    assert refused["code"] == "malformed"
    assert refused["detail"].startswith(field)


@pytest.mark.parametrize("size", ["640", "a,b", "640,360,1", "0,1", "nan,1", "6" * 50])
def test_what_is_no_size_in_a_query_is_refused_by_name(corner, size):
    document = problem(
        corner.post(URL, params={"size": size}, json={"tracks": []}), 422, "malformed"
    )
    assert document["errors"][0]["pointer"] == "/size"


def test_numbers_that_no_float_holds_once_scaled_are_refused_by_name(corner):
    track = {"id": "1", "points": [[T0 + n, 1e308, 1.0] for n in range(6)]}
    document = problem(
        corner.post(URL, json={"tracks": [track], "normalised": True}), 422, "nothing_taken"
    )
    assert "finite" in document["detail"]


@pytest.mark.parametrize("small", [0, 2**20])
def test_unknown_fields_are_named_and_refuse_nothing(corner, monkeypatch, small):
    monkeypatch.setattr(json_body, "_SMALL", small)
    track = {"id": "1", "boxes": rows(IN_640), "colour": {"red": 1}}
    body = {"firmware": [1, {}], "tracks": [track], "size": [640, 360]}
    answer = corner.post(URL, json=body)
    assert answer.status_code == 202
    assert answer.json()["accepted"] == 1
    assert answer.json()["ignored"] == ["firmware", "tracks/*/colour"]


@pytest.mark.parametrize("small", [0, 2**20])
def test_of_many_unknown_fields_some_are_named_shortly(corner, monkeypatch, small):
    monkeypatch.setattr(json_body, "_SMALL", small)
    unknown = {f"{n}" + "\ud800" * 300: 0 for n in range(50)} if small else {"x" * 300: 0}
    track = {"id": "1", "boxes": rows(IN_640), **unknown}
    body = json.dumps({"tracks": [track], **unknown})  # with halves of surrogate pairs, as escapes
    headers = {"Content-Type": "application/json"}
    names = corner.post(URL, content=body, headers=headers).json()["ignored"]
    assert len(names) == (20 if small else 2)
    assert max(map(len, names)) <= 80 + len("tracks/*/")
