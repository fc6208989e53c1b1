"""Frigate's messages: which are tracks, and of what."""

import contextlib
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from surefoot.bridge.feeds import Topics
from surefoot.bridge.frigate import read_event
from surefoot.bridge.values import MAX_MESSAGE_BYTES, MessageError
from tests.surefoot.bridge.stand import frigate_event

PATH = [[[0.5, 0.4 + 0.1 * n], 1_700_000_000.5 + n] for n in range(5)]


def read(document, cameras=None):
    topics = Topics(prefix="surefoot", frigate="frigate", cameras=cameras or {})
    _, found = topics.read("frigate/events", json.dumps(document).encode())
    return found[0] if found else None


def test_the_end_of_a_person_is_a_track_of_the_feet():
    found = read(frigate_event("end", "17.5-abc", "front", PATH))
    assert (found.camera, found.track_id, found.label, found.form) == (
        "front", "17.5-abc", "person", "points",
    )  # fmt: skip
    assert found.size == (1.0, 1.0)
    assert found.rows.tolist()[:6] == [1_700_000_000.5, 0.5, 0.4, 1_700_000_001.5, 0.5, 0.5]


def test_feet_at_the_lower_edge_are_none():
    path = [*PATH, [[0.5, 0.99], 1_700_000_009.0], [[0.5, 1.0], 1_700_000_010.0]]
    assert read(frigate_event("end", "1", "front", path)).rows == (
        read(frigate_event("end", "1", "front", PATH)).rows
    )
    assert read(frigate_event("end", "1", "front", path[-2:])) is None


@pytest.mark.parametrize(
    "event",
    [
        frigate_event("new", "1", "front", PATH),
        frigate_event("update", "1", "front", PATH),
        frigate_event("end", "1", "front", PATH, label="car"),
        frigate_event("end", "1", "front", PATH, false_positive=True),
        frigate_event("end", "1", "front", []),
    ],
)
def test_other_messages_are_none(event):
    assert read(event) is None


def test_cameras_are_mapped_or_spelled_as_ids_are():
    assert read(frigate_event("end", "1", "Front_Door", PATH)).camera == "front-door"
    mapped = {"Front_Door": "town-centre"}
    assert read(frigate_event("end", "1", "Front_Door", PATH), mapped).camera == "town-centre"


@pytest.mark.parametrize(
    "message",
    [
        b"",
        b"\xff\xfe",
        b"[]",
        b'{"type": "end"}',
        json.dumps(frigate_event("end", "1", "front", [[0.5, 0.5, 17.0]])).encode(),
        json.dumps(frigate_event("end", "1", "front", [[["a", 0.5], 17.0]])).encode(),
        json.dumps(frigate_event("end", "x" * 201, "front", PATH)).encode(),
        json.dumps(frigate_event("end", "1", "front", PATH) | {"pad": "x" * 2_000_000}).encode(),
    ],
)
def test_what_is_none_of_frigates_is_named(message):
    with pytest.raises(MessageError) as caught:
        read_event(message, str)
    assert caught.value.code == ("too_large" if len(message) > MAX_MESSAGE_BYTES else "malformed")


def test_a_frigate_without_paths_is_told_so():
    event = frigate_event("end", "1", "front", PATH)
    del event["after"]["path_data"]
    with pytest.raises(MessageError, match=r"0\.16"):
        read(event)


@given(st.recursive(st.none() | st.booleans() | st.floats() | st.text(), st.lists))
def test_whatever_a_path_is_it_is_read_or_refused(path):
    event = frigate_event("end", "1", "front", PATH)
    event["after"]["path_data"] = path
    with contextlib.suppress(MessageError):
        read(event)
