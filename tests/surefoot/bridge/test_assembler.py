"""Frames in, whole tracks out: nothing lost, nothing twice, and no more memory than was said."""

import json

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from surefoot.bridge.assembler import Assembler, StateError
from surefoot.bridge.values import NORMALISED, Detection, Ended, body_of

T0 = 1_700_000_000.0


def seen(track_id="7", at=0.0, camera="yard", size=(1280.0, 720.0), label="person"):
    box = (100.0 + at, 50.0, 140.0 + at, 200.0)
    return Detection(camera, T0 + at, track_id, label, box, size)


def walk(assembler, track_id="7", count=6, start=0.0, **others):
    for n in range(count):
        assembler.add(seen(track_id, start + n * 0.5, **others), T0 + start + n * 0.5)


def test_an_end_finishes_a_track_and_a_body_says_it_as_the_service_takes_it():
    assembler = Assembler()
    walk(assembler)
    assembler.add(Ended("yard", "7"), T0 + 3)
    (track,) = assembler.take()
    body = json.loads(body_of(track.head("axis"), [track.to_json()]))
    assert body["size"] == [1280.0, 720.0]
    assert body["tracks"][0]["class"] == "person"
    assert body["tracks"][0]["boxes"][1] == [T0 + 0.5, 100.5, 50.0, 140.5, 200.0]
    assert len(body["tracks"][0]["boxes"]) == 6
    assert assembler.take() == []


def test_a_silence_finishes_by_the_clock_of_who_assembles_and_by_the_sources():
    assembler = Assembler(silence_s=5)
    walk(assembler)
    assembler.tick(T0 + 7.4)
    assert assembler.open_tracks == 1
    assembler.tick(T0 + 7.5)
    assert assembler.open_tracks == 0
    # After an outage two people of one id come within a second of ours.
    walk(assembler, "8")
    assembler.add(seen("8", 3600), T0 + 3)
    assert [len(track.rows) // 5 for track in assembler.take()] == [6, 6]
    assert assembler.open_tracks == 1


def test_what_comes_twice_or_out_of_turn_is_there_once_in_order():
    assembler = Assembler()
    for at in (0.0, 1.0, 0.5, 1.0, 1.5):
        assembler.add(seen(at=at), T0)
    assembler.finish_all()
    (track,) = assembler.take()
    assert track.rows[::5].tolist() == [T0, T0 + 0.5, T0 + 1, T0 + 1.5]


def test_what_a_broker_sends_again_after_a_crash_makes_no_second_track():
    assembler = Assembler()
    walk(assembler)
    assembler.add(Ended("yard", "7"), T0)
    assert len(assembler.take()) == 1
    restarted = Assembler()
    restarted.restore(assembler.state())
    walk(restarted)
    restarted.add(Ended("yard", "7"), T0)
    assert restarted.open_tracks == 0
    assert restarted.take() == []


def test_what_is_sent_again_of_an_open_track_however_old_is_there_once():
    assembler = Assembler(silence_s=5)
    walk(assembler, count=40)
    walk(assembler, count=5)
    assembler.finish_all()
    (track,) = assembler.take()
    assert track.rows[::5].tolist() == [T0 + 0.5 * n for n in range(40)]


def test_what_was_away_ends_no_track_before_what_waits_was_heard():
    assembler = Assembler(silence_s=5)
    walk(assembler)
    assembler.hear_all(T0 + 100)
    assembler.tick(T0 + 104)
    assert assembler.open_tracks == 1


def test_a_stream_of_another_size_is_another_track():
    assembler = Assembler()
    walk(assembler)
    walk(assembler, start=3, size=NORMALISED)
    assembler.finish_all()
    first, second = assembler.take()
    assert first.head("x") == b'{"source":"x","size":[1280.0,720.0]}'
    assert second.head("x") == b'{"source":"x","normalised":true}'


@pytest.mark.parametrize("bound", [{"max_tracks": 3}, {"max_points": 18}])
def test_the_one_unheard_longest_is_finished_where_there_is_no_room(bound):
    assembler = Assembler(**bound)
    for track_id in "abc":
        walk(assembler, track_id)
    assembler.add(seen("a", 3.0), T0 + 3)  # heard of again: b is the longest unheard
    assembler.add(seen("d", 3.0), T0 + 3)
    assert [track.track_id for track in assembler.take()] == ["b"]


@pytest.mark.parametrize("saved", [b"", b"x", b"\x93\x02\x91\x96\x90", b"\x93\x01\x90\x90"])
def test_a_broken_state_is_refused_and_changes_nothing(saved):
    assembler = Assembler()
    walk(assembler)
    with pytest.raises(StateError):
        assembler.restore(saved)
    assert assembler.open_tracks == 1


_EVENTS = st.lists(
    st.tuples(
        st.sampled_from(("seen", "end", "tick", "restart", "post")),
        st.sampled_from("abcd"),
        st.sampled_from(("yard", "gate")),
    ),
    max_size=80,
)


@given(_EVENTS, st.integers(1, 4), st.integers(1, 12))
def test_whatever_happens_each_detection_comes_out_once_and_the_bounds_hold(
    events, max_tracks, max_points
):
    bounds = {"max_tracks": max_tracks, "max_points": max_points}
    assembler, at, added, out = Assembler(**bounds), 0.0, set(), []

    def post():
        tracks = assembler.take()
        out.extend(
            (track.camera, track.track_id, time_s) for track in tracks for time_s in track.rows[::5]
        )

    for kind, track_id, camera in events:
        at += 0.5
        if kind == "seen":
            assembler.add(seen(track_id, at, camera), T0 + at)
            added.add((camera, track_id, T0 + at))
        elif kind == "end":
            assembler.add(Ended(camera, track_id), T0 + at)
        elif kind == "tick":
            assembler.tick(T0 + at)
        elif kind == "restart":
            post()
            saved = assembler.state()
            assembler = Assembler(**bounds)
            assembler.restore(saved)
            assert assembler.state() == saved
        elif kind == "post":
            post()
        assert assembler.open_tracks <= max_tracks
    assembler.finish_all()
    post()
    assert len(out) == len(set(out))
    assert set(out) == added


def test_a_late_message_cuts_no_walk():
    assembler = Assembler(silence_s=5)
    walk(assembler, count=40)
    assembler.add(seen(at=1.25), T0 + 20)  # on its way for longer than a silence
    saved = assembler.state()
    for each in (assembler, Assembler(silence_s=5)):
        each.restore(saved)
        walk(each, count=10, start=20)
        each.finish_all()
        (track,) = each.take()
        assert len(track.rows) // 5 == 51


def test_who_stays_for_hours_is_some_tracks_that_the_service_takes():
    assembler = Assembler()
    for second in range(7_500):
        assembler.add(seen(at=float(second)), T0 + second)
    assembler.finish_all()
    tracks = assembler.take()
    assert sum(len(track.rows) // 5 for track in tracks) == 7_500
    assert [track.rows[-5] - track.rows[0] for track in tracks] == [3_600, 3_600, 297]


def test_track_keeps_the_detections_of_a_person_only():
    assembler = Assembler()
    labels = ["car", "person", "person", "car", "Person", None, "person", "7"]
    for n, label in enumerate(labels):
        assembler.add(seen(at=0.5 * n, label=label), T0 + 0.5 * n)
    walk(assembler, "bus", label="bus")
    assembler.finish_all()
    person, bus = assembler.take()
    assert person.label == "person"
    assert [row - T0 for row in person.rows[::5]] == [0.5, 1.0, 2.0, 2.5, 3.0]
    assert (bus.label, len(bus.rows) // 5) == ("bus", 6)


def test_detections_with_confidence_0_give_way_to_others_and_are_marked_alone():
    assembler = Assembler()
    for n, confidence in enumerate((0.0, 0.0, None, 0.0, None)):
        for track_id, value in (("a", confidence), ("b", 0.0)):
            found = seen(track_id, at=0.5 * n)
            assembler.add(msgspec.structs.replace(found, confidence=value), T0 + 0.5 * n)
    again = Assembler()
    again.restore(assembler.state())
    again.finish_all()
    a, b = again.take()
    assert (a.confidence, len(a.rows) // 5) == (None, 2)
    assert (b.confidence, len(b.rows) // 5) == (0.0, 5)
    assert b'"confidence":0' in b.to_json()
    assert again._open_points == 0
