"""Large JSON bodies: the same tracks as of small ones, and next to nothing built of the rest."""

import json
import tracemalloc

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.errors import MalformedError, TooLargeError
from service.formats import batch, json_body
from service.formats.batch import read_json, read_ndjson
from service.formats.track import Clock, Limits
from tests.conftest import track
from tests.service.conftest import problem

CLOCK = Clock(frame_rate_hz=25.0, started_at_s=1_700_000_000.0)
LIMITS = Limits(width=1280, height=720, now_s=1_800_000_000.0, max_ahead_s=60.0)
MB = 2**20

values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=12,
)
names = st.sampled_from(["points", "boxes", "frames", "frame_boxes", "id", "class", "a", "\\"])
walks = st.builds(
    lambda name, change: {**track(name), **change},
    st.text(min_size=1) | st.integers(),
    st.just({}) | st.dictionaries(names, values, max_size=1),
)
documents = st.dictionaries(st.sampled_from(["a", '"{', "\\", "NaN"]), values, max_size=3)


@pytest.fixture
def everything_is_large(monkeypatch):
    monkeypatch.setattr(json_body, "_SMALL", 0)


def read_lines(body, clock, limits):
    return read_ndjson(body, "a", clock, limits)


def read(body, small, reader=read_json):
    """What is taken of a body, and which of its tracks are not; None of one that is no JSON."""
    kept, json_body._SMALL = json_body._SMALL, small
    try:
        found = reader(body, CLOCK, LIMITS)
    except (MalformedError, TooLargeError):
        return None
    finally:
        json_body._SMALL = kept
    taken = [(one.track_id, one.points.tolist()) for one in found.tracks]
    return taken, len(found.rejections) + sum(found.skipped.values())


@settings(max_examples=300, deadline=None)
@given(documents, st.lists(walks | values, max_size=5), st.sampled_from([None, 1]), st.booleans())
def test_the_same_tracks_are_taken(document, tracks, indent, first):
    made = {"tracks": tracks, **document} if first else {**document, "tracks": tracks}
    body = json.dumps(made, indent=indent, ensure_ascii=first).encode()
    assert read(body, 0) == read(body, MB)


@settings(max_examples=300, deadline=None)
@given(st.lists(walks | values, max_size=5), st.booleans())
def test_the_same_lines_are_taken(tracks, ascii_only):
    body = "\n".join(json.dumps(one, ensure_ascii=ascii_only) for one in tracks).encode()
    assert read(body, -1, read_lines) == read(body, MB, read_lines)


def test_a_mark_before_the_first_line_loses_no_track():
    body = "\n".join(json.dumps(track(name)) for name in "12").encode("utf-8-sig")
    assert len(read(body, 0, read_lines)[0]) == 2
    assert read(body, 0, read_lines) == read(body, MB, read_lines)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-32-le"])
def test_other_encodings_are_read(encoding):
    body = json.dumps({"tracks": [track("1")]}).encode(encoding)
    assert read(body, 0) == read(body, MB)
    assert len(read(body, 0)[0]) == 1


@pytest.mark.parametrize(
    "text",
    ["", "[", "{", '{"a"', '{"a":', '{"a":1', '{"a":1,}', '{"tracks":[1,]}', '{"tracks":[1 2]}',
     '{"tracks":[}', '{"tracks":[{]}', '{1:2}', '{"a":1} x', '{"tracks":[{"a":}]}', '{"a" 1}',
     '{"tracks":[tru]}', '{"a":"x}', '{"tracks":["x]}', "[1]", '{"tracks":3}', "NaN", "nope NaN"],
)  # fmt: skip
def test_what_is_no_json_is_told_so(everything_is_large, text):
    with pytest.raises(MalformedError):
        read_json(text.encode(), CLOCK, LIMITS)


def test_a_track_that_cannot_be_read_is_named_and_loses_none_beside_it(everything_is_large):
    rows = track("1")["points"]
    tracks = [
        {"id": "word", "points": [*rows, [1.0, "x", 3.0]]},
        {"id": "null", "points": [*rows, [1.0, None, 3.0]]},
        {"id": "NaNcy", "points": [*rows, [1.0, float("nan"), 3.0]]},
        {"id": "short", "points": [*rows, [1.0]]},
        {"id": "none", "points": "NaN"},
        7,
        track("Infinity"),
    ]
    whole = read_json(json.dumps({"tracks": tracks}).encode(), CLOCK, LIMITS)
    lines = read_lines("\n".join(map(json.dumps, tracks)).encode(), CLOCK, LIMITS)
    for found in (whole, lines):
        said = [(one.index, one.track_id, one.code) for one in found.rejections]
        assert said == [
            (0, "word", "malformed"), (1, "null", "not_finite"), (2, "NaNcy", "not_finite"),
            (3, "short", "malformed"), (4, "none", "malformed"), (5, None, "malformed"),
        ]  # fmt: skip
        assert found.rejections[0].detail == f"points/{len(rows)}/1: Expected `float`, got `str`"
        assert [one.track_id for one in found.tracks] == ["Infinity"]


def test_a_body_of_nothing_but_words_is_no_json():
    """Eleven million of them became 50 MB, and kept `/healthz` for 400 ms."""
    words = "NaN," * (json_body._MOST_GROWTH // 2)
    body = f'{{"tracks": [{{"id": "1", "points": [[{words}NaN]]}}]}}'
    with pytest.raises(MalformedError, match="the body cannot be read"):
        read_json(body.encode(), CLOCK, LIMITS)


def test_a_track_too_long_to_read_loses_none_beside_it(corner):
    rows = ",".join(["[1700000000.0,100.25,200.5]"] * 100_000)
    long = f'{{"id": "long", "points": [{rows}]}}'
    good = json.dumps(track("good"))
    forms = {
        "application/json": f'{{"tracks": [{long}, {good}], "source": "last"}}',
        "application/x-ndjson": f"{long}\n{good}\n",
    }
    for media_type, body in forms.items():
        answer = corner.post(
            "/cameras/corner/tracks", content=body, headers={"Content-Type": media_type}
        )
        assert answer.json()["accepted"] == 1, answer.text
        (refused,) = answer.json()["rejected"]
        assert (refused["id"], refused["code"]) == ("long", "too_many_points")


def test_what_else_is_large_is_refused():
    body = json.dumps({"tracks": [], "source": "x" * MB}).encode()
    with pytest.raises(TooLargeError, match=f"source: at most 4096 bytes are taken, got {MB + 2}"):
        read_json(body, CLOCK, LIMITS)


@pytest.mark.parametrize(
    ("before", "unit", "after"),
    [
        ('{"source": "', "a", '"}'),
        ('{"tracks": [', "1,", "1]}"),
        ('{"tracks": [{"id": 1, "points": [', "[],", "1]}]}"),
        ('{"tracks": [', '{"id": 1, "points": [' + "[]," * 99_999 + "1]},", "1]}"),
        ("{", '"a": 1,', '"tracks": []}'),
        ('{"a": [', "{},", '1], "tracks": []}'),
    ],
)
def test_little_is_built_of_what_is_no_track(before, unit, after):
    """Of 4 MiB, in the forms of issue 38, which took 117 bytes for one of the body."""
    body = (before + unit * (4 * MB // len(unit)) + after).encode()
    assert peak_of(lambda: read(body, MB)) < 12 * MB


def test_lines_are_counted_before_they_are_taken_apart():
    for text in (b"11\n" * MB, b"\n" * 4 * MB):

        def refused(text=text):
            with pytest.raises(TooLargeError, match="at most 20000 ends of one are taken, got"):
                read_ndjson(text, "a", CLOCK, LIMITS)

        assert peak_of(refused) < MB


def peak_of(act):
    """The most memory that something took at a time, in bytes."""
    tracemalloc.start()
    try:
        act()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_reading_ends_when_it_has_taken_its_seconds(corner, monkeypatch):
    monkeypatch.setattr(batch, "MAX_CPU_S", -1.0)
    headers = {"Content-Type": "text/csv"}
    lines = "1,1,1,1,9,9,1\n" * 1_000
    url = "/cameras/corner/tracks?started_at=2023-11-14T22:13:20Z"
    for answer in (
        corner.post(url, json={"tracks": [track("1")]}),
        corner.post(url, content=lines, headers=headers),
    ):
        document = problem(answer, 413, "too_large")
        assert document["detail"].startswith("body: at most -1 s of CPU are spent on reading one")
