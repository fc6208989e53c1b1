"""Large bodies: read track by track, as `json.loads` reads the whole."""

import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.errors import TooLargeError
from service.formats import json_body
from service.formats.json_body import OversizedTrack, TrackTexts, read_document
from tests.conftest import track
from tests.service.conftest import problem

values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=12,
)
documents = st.dictionaries(st.sampled_from(["source", "a", '"{', "\\"]), values, max_size=3)


def whole(document):
    return {
        name: list(value) if isinstance(value, TrackTexts) else value
        for name, value in document.items()
    }


@pytest.fixture
def everything_is_large(monkeypatch):
    monkeypatch.setattr(json_body, "_SMALL", 0)


@settings(max_examples=200, deadline=None)
@given(documents, st.lists(values, max_size=5), st.sampled_from([None, 1]), st.booleans())
def test_the_same_as_json_reads(document, tracks, indent, first):
    made = {"tracks": tracks, **document} if first else {**document, "tracks": tracks}
    body = json.dumps(made, indent=indent, ensure_ascii=first).encode()
    small, json_body._SMALL = json_body._SMALL, 0
    try:
        assert whole(read_document(body)) == json.loads(body)
    finally:
        json_body._SMALL = small


def test_what_else_is_large_is_refused():
    body = json.dumps({"tracks": [], "more": "x" * 1024 * 1024}).encode()
    with pytest.raises(TooLargeError, match="more: at most 1048576 characters"):
        read_document(body)


@pytest.mark.parametrize(
    "text",
    ["", "[", "{", '{"a"', '{"a":', '{"a":1', '{"a":1,}', '{"tracks":[1,]}', '{"tracks":[1 2]}',
     '{"tracks":[}', '{"tracks":[{]}', '{1:2}', '{"a":1} x', '{"tracks":[{"a":}]}', '{"a" 1}',
     '{"tracks":[tru]}', '{"a":"x}', '{"tracks":["x]}', "[1]"],
)  # fmt: skip
def test_what_is_no_json_is_told_so(everything_is_large, text):
    with pytest.raises(ValueError):  # noqa: PT011 - the place differs from case to case
        whole(read_document(text.encode()))


def test_a_track_too_long_to_read_loses_none_beside_it(corner):
    rows = ",".join(["[1700000000.0,100.25,200.5]"] * 100_000)
    long = f'{{"id": "long", "points": [{rows}]}}'
    answer = corner.post(
        "/cameras/corner/tracks",
        content=f'{{"tracks": [{long}, {json.dumps(track("good"))}], "source": "last"}}',
        headers={"Content-Type": "application/json"},
    )
    assert answer.json()["accepted"] == 1, answer.text
    assert answer.json()["rejected"][0]["code"] == "too_many_points"
    answer = corner.post(
        "/cameras/corner/tracks?source=other",
        content=f"{long}\n{json.dumps(track('good'))}\n",
        headers={"Content-Type": "application/x-ndjson"},
    )
    assert answer.json()["accepted"] == 1
    assert answer.json()["rejected"][0]["code"] == "too_many_points"
    spans = TrackTexts(text=" " * 3_000_000, spans=((0, 3_000_000),))
    assert list(spans) == [OversizedTrack(characters=3_000_000)]


def test_bodies_have_limits_by_their_kind(corner, settings):
    large = b" " * (1024 * 1024 + 1)
    chunks = (b" " * 65536 for _ in range(20))  # whose length nobody declares
    problem(corner.post("/cameras", content=large), 413, "too_large")
    problem(corner.post("/cameras", content=chunks), 413, "too_large")
    problem(corner.post("/ui/preview", content=large), 413, "too_large")
    problem(corner.request("GET", "/cameras", content=large), 413, "too_large")
    json_type = {"Content-Type": "application/json"}
    answer = corner.post("/cameras/corner/tracks", content=large, headers=json_type)
    problem(answer, 422, "malformed")
    held = (b" " * 2**20 for _ in range(33))
    problem(
        corner.post("/cameras/corner/tracks", content=held, headers=json_type), 413, "too_large"
    )
    assert 'surefoot_http_refusals_total{code="too_large"} 5.0' in corner.get("/metrics").text
