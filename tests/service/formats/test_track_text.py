"""Posts of text tables: MOTChallenge text, its limits, and how bad lines are answered."""

import tracemalloc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sqlalchemy import select

from service.errors import MalformedError, TooLargeError
from service.formats import track_text
from service.formats.track import Clock, Limits
from service.formats.track_text import read_text
from service.store.engines.store import Store
from service.store.tracks import TrackRecord, unpack
from surefoot.tabular import lines
from surefoot.tabular.head import read_head
from surefoot.tabular.recognition import plan_of
from tests.service.conftest import problem

T0 = 1_700_000_000.0


def send(http, lines, **query):
    return http.post(
        "/cameras/corner/tracks",
        params={"started_at": "2023-11-14T22:13:20Z", **query},
        content="\n".join(lines),
        headers={"Content-Type": "text/csv"},
    )


def stored(settings):
    with Store(settings).read() as session:
        return list(session.scalars(select(TrackRecord).order_by(TrackRecord.id)))


def walk(track_id, rest="1", every=25, count=6):
    """Lines of a track from frame 1 on, at 25 frames a second."""
    return [f"{n * every + 1},{track_id},{101 + n},51,40,150,{rest}" for n in range(count)]


def test_frames_and_pixels_count_from_1_and_lines_come_in_any_order(corner, settings):
    rows = [f"{n * 10 + 1},7,101,51,40,{150 + n},1,-1,-1,-1" for n in range(8)]
    rows += ["5,7,0,0,10,10,0,-1,-1,-1"]  # conf 0: to be ignored
    answer = send(corner, reversed(rows), frame_rate_hz=10)
    assert answer.json() == {"accepted": 1, "duplicates": 0, "rejected": []}
    (record,) = stored(settings)
    points = unpack(record.points, 3)
    np.testing.assert_allclose(points[:, 0] - T0, np.arange(8))
    assert points[3].tolist()[1:] == [120.0, 203.0]
    assert unpack(record.boxes, 4)[3].tolist() == [100.0, 50.0, 140.0, 203.0]


@pytest.mark.parametrize(
    ("person", "car"),
    [
        ("0.9,0,-1", "0.9,2,-1"),  # BoxMOT: COCO's numbers
        ("0.9,0", "0.9,2"),
        ("1,1,0.86", "1,3,1"),  # MOTChallenge ground truth: 3 is a car, 2 a person on wheels
        ("1,7,0.5", "0,2,0.5"),
    ],
)
def test_a_car_is_no_person(corner, settings, person, car):
    answer = send(corner, walk("p", person) + walk("c", car)).json()
    assert answer == {
        "accepted": 1, "duplicates": 0, "rejected": [], "skipped": {"not_a_person": 1},
    }  # fmt: skip
    assert [record.track_id for record in stored(settings)] == ["p"]


@pytest.mark.parametrize("rest", ["1", "0.7,-1,-1,-1", "1,-1,-1", "1,12.5,3.25,0"])
def test_lines_without_a_class_are_of_people(corner, settings, rest):
    assert send(corner, walk("p", rest)).json()["accepted"] == 1


def test_a_query_says_which_classes_are_people(corner, settings):
    lines = walk("a", "0.9,3,0,0") + walk("b", "0.9,4,0,0") + walk("c", "0.9,5,0,0")
    answer = send(corner, lines, classes="3,5").json()
    assert (answer["accepted"], answer["skipped"]) == (2, {"not_a_person": 1})
    assert [record.track_id for record in stored(settings)] == ["a", "c"]
    document = problem(send(corner, lines, classes="0;1"), 422, "malformed")
    assert document["errors"][0]["pointer"] == "/classes"


def test_a_detector_that_changes_its_mind_loses_those_lines_alone(corner, settings):
    lines = walk("p", "0.9,0,-1", count=9)
    lines[4] = lines[4].replace("0.9,0", "0.9,1")
    answer = send(corner, lines).json()
    assert (answer["accepted"], answer.get("skipped")) == (1, None)
    assert len(unpack(stored(settings)[0].points, 3)) == 8


def test_post_tracks_of_cars_only_names_their_class(corner, settings):
    answer = send(corner, walk("c", "0.9,2,-1")).json()
    assert (answer["accepted"], answer["skipped"]) == (0, {"not_a_person": 1})
    assert answer["detail"] == (
        "No track was stored: 1 not of a person (classes 2); name the classes of people with "
        "?classes= if they are."
    )
    assert stored(settings) == []


def test_malformed_text_costs_only_its_own_track(corner, settings):
    lines = walk("1") + walk("2")
    lines[8] = "51,2,oops,50,40,150,1"
    answer = send(corner, lines).json()
    assert answer["accepted"] == 1
    assert answer["rejected"][0]["id"] == "2"
    assert "line 9" in answer["rejected"][0]["detail"]
    assert [record.track_id for record in stored(settings)] == ["1"]


@pytest.mark.parametrize("at", [0, 3, 5])
def test_post_tracks_counts_a_broken_track_as_rejected_only(corner, at):
    lines = [*walk("broken", "0"), *walk("whole"), *walk("ignored", "0")]
    lines[at] = lines[at].replace("51,40", "oops,40")
    answer = send(corner, lines).json()
    assert (answer["accepted"], answer["skipped"]) == (1, {"ignored_by_confidence": 1})
    assert [each["id"] for each in answer["rejected"]] == ["broken"]


def test_a_text_whose_first_track_is_broken_from_its_first_line_on_loses_that_alone(corner):
    lines = walk("1") + walk("2")
    lines[0] = "1,1,oops,50,40,150,1"
    answer = send(corner, lines).json()
    assert (answer["accepted"], [each["index"] for each in answer["rejected"]]) == (1, [0])


@pytest.mark.parametrize("wrong", ["9", "x", "1_0", "1,2", '"3"', "1" * 1_001])
@pytest.mark.parametrize("separator", [",", "\t", ";", " "])
def test_read_lines_in_blocks_equals_line_by_line(monkeypatch, wrong, separator):
    text = [*walk("007", "1.0,-1,-1,-1"), *walk("b", "0.9,-1,-1,ten", count=4)]
    text += ["9,7,1,1,9,9,1,-1,-1,-1".replace("9", wrong, 1)]
    body = "\n".join(text).replace(",", separator).encode()
    head = read_head(body)
    plan = plan_of(head, None, 0)

    def read():
        found = lines.read_lines(body, head, plan, lines.Bounds())
        numbers = found.numbers(len(plan.numbers))
        return found.names, found.broken, found.tracks.tolist(), np.nan_to_num(numbers).tolist()

    read_as = []
    for block in (1, 3, 1_000):
        monkeypatch.setattr(lines, "_BLOCK", block)
        read_as.append(read())
    monkeypatch.setattr(lines, "_read_even", lambda *_: False)
    assert all(found == read() for found in read_as)
    assert len(read_as[0][2]) >= 10


def test_a_text_of_too_many_lines_is_refused_before_it_is_read(corner, monkeypatch):
    monkeypatch.setattr(track_text, "MAX_LINES", 5)
    answer = send(corner, walk("7", count=7), frame_rate_hz="25")
    body = problem(answer, 413, "too_large")
    assert "at most 5 a request are taken, got 6" in body["detail"]


def test_what_is_no_such_text_or_lacks_its_clock(corner):
    url, headers = "/cameras/corner/tracks", {"Content-Type": "text/csv"}
    problem(corner.post(url, content="1,1,1,1,1,1,1", headers=headers), 422, "malformed")
    document = problem(send(corner, ["a;b;c"]), 422, "malformed")
    reason = document["errors"][0]["reason"]
    assert reason.startswith("not a table of tracks: line 1 has 3 columns separated by semicolons")
    problem(send(corner, ["1,1,2,3"]), 422, "malformed")
    assert send(corner, ["frame,id", ""]).json()["accepted"] == 0


_TEXT = "\n".join([*walk("7"), *walk("8", "0.9,0,1"), "1,9,1,1,1,1,1,-1,-1,-1"]).encode()
_CLOCK = Clock(frame_rate_hz=25.0, started_at_s=T0)
_LIMITS = Limits(width=1280, height=720, now_s=T0 + 1e6, max_ahead_s=60.0)


@given(data=st.data())
def test_bytes_that_were_changed_cut_or_repeated_are_read_or_refused_by_name(data):
    begin, end = sorted(data.draw(st.tuples(*[st.integers(0, len(_TEXT))] * 2)))
    between = data.draw(
        st.binary(max_size=8)
        | st.just(_TEXT[begin:end] * 2)
        | st.sampled_from([b"nan", b"-1e999", b"9" * 400, b"\0", b",", b"\r"])
    )
    try:
        batch = read_text(_TEXT[:begin] + between + _TEXT[end:], "s", _CLOCK, _LIMITS)
    except (MalformedError, TooLargeError):
        return
    assert all(np.isfinite(each.points).all() for each in batch.tracks)
    assert all(each.code and each.detail for each in batch.rejections)


def test_the_form_to_register_with_reads_it_the_same(http):
    answer = http.post(
        "/ui/tracks",
        params={"width": 1280, "height": 720},
        content="\n".join(walk("p", "1,1,0.9") + walk("c", "0,3,0.9")),
    ).json()
    assert answer["text"] == "1 track read; 1 track skipped: not a person."
    assert answer["tracks"][0][0] == [0.0, 120.0, 200.0]


@pytest.mark.parametrize("end", ["\r", "\r\n", "\n\r\n"])
def test_lines_end_as_elsewhere(corner, settings, end):
    answer = corner.post(
        "/cameras/corner/tracks?started_at=2023-11-14T22:13:20Z",
        content=end.join([*walk("a\x0bb"), *walk("a\u2028b")]),  # no ends of lines
        headers={"Content-Type": "text/csv"},
    )
    assert answer.json()["accepted"] == 2, answer.text


def test_every_end_of_a_line_counts(corner):
    """`x\\r` 16 million times took 5 GB, since the lines were counted by their `\\n`."""
    document = problem(send(corner, ["x\r" * (track_text.MAX_LINES + 1)]), 413, "too_large")
    assert f"lines: at most {track_text.MAX_LINES} a request are taken, got" in document["detail"]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("1," * 2**20, "separated by commas and at most 1000 characters"),
        ("x\n" * 6_000, "not a table of tracks: line 1"),
    ],
)
def test_little_is_built_of_what_is_no_line(corner, line, said):
    tracemalloc.start()
    try:
        document = problem(send(corner, [line]), 422, "malformed")
        assert tracemalloc.get_traced_memory()[1] < 12 * 2**20
    finally:
        tracemalloc.stop()
    assert said in document["errors"][0]["reason"]


def test_a_broken_track_is_read_no_further_where_nothing_else_can_be(corner):
    """400,000 such lines took 3 s, since any of them might have been the first that is right."""
    broken = ["1,7,x,1,9,9,1"] * 10_500
    document = problem(send(corner, [*broken, *walk("7")]), 422, "malformed")
    assert "not a table of tracks: line 1:" in document["errors"][0]["reason"]
    answer = send(corner, [*broken, *walk("8")]).json()
    assert answer["accepted"] == 1
    assert [each["id"] for each in answer["rejected"]] == ["7"]


def test_ids_are_bounded_whatever_they_are_of(corner):
    lines = (f"1,{n},1,1,9,9,1,5" for n in range(20_001))  # a car each
    document = problem(send(corner, lines), 413, "too_large")
    assert document["detail"].startswith("ids: at most 20000 of all classes")


def test_a_mark_of_the_order_of_bytes_costs_no_line(corner, settings):
    first, *others = walk("7")
    send(corner, ["\ufeff" + first, *others], frame_rate_hz=25).raise_for_status()
    (record,) = stored(settings)
    assert len(unpack(record.points, 3)) == 6
