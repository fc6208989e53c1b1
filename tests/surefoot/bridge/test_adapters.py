"""Each source's own message: the same person at the same place, or a rejection with a name."""

import json
import math
import re
from datetime import UTC, datetime

import pytest
from hypothesis import given
from hypothesis import strategies as st

from surefoot.bridge import axis, frigate, onvif, rows
from surefoot.bridge.assembler import Assembler
from surefoot.bridge.onvif import Profile
from surefoot.bridge.values import (
    MAX_DETAIL,
    MAX_MESSAGE_BYTES,
    NORMALISED,
    Detection,
    Ended,
    MessageError,
    SkippedRow,
    WholeTrack,
)
from tests.surefoot.bridge import samples
from tests.surefoot.bridge.samples import READERS, TRACK_READERS, T

ALL_READERS = READERS | TRACK_READERS
NESTED = b'{"x":' + b"[" * 5_000 + b"]" * 5_000 + b"}"
PLACE = (0.25, 0.5, 0.3, 0.75)  # of the person in every sample but ONVIF's own


def _is_json(source):
    return source not in ("onvif_xml", "supervision_csv", "ultralytics_text")


def shares(found):
    assert found.size is not None
    width, height = found.size
    x1, y1, x2, y2 = found.box
    return (x1 / width, y1 / height, x2 / width, y2 / height)


@pytest.mark.parametrize("source", [name for name in READERS if name != "onvif_json"])
def test_the_sample_is_one_person_at_one_place(source):
    message, read = READERS[source]
    (person,) = [found for found in read(message) if isinstance(found, Detection)]
    assert shares(person) == pytest.approx(PLACE, abs=1e-6)
    assert (person.camera, person.track_id) == ("yard", {"axis": "a1b2"}.get(source, "7"))
    assert person.label.lower() in ("person", "human")
    assert person.time_s == pytest.approx(T, abs=1e-6)


@pytest.mark.parametrize("source", ["axis_consolidated", "axis_object_track"])
def test_read_axis_finished_track_returns_its_boxes_and_likeliest_class(source):
    message, read = TRACK_READERS[source]
    (track,) = read(message)
    assert (track.camera, track.track_id, track.label) == ("yard", "7", "Human")
    assert (track.form, track.size) == ("boxes", NORMALISED)
    assert track.rows.tolist() == [
        *(T, 0.25, 0.5, 0.3, 0.75),
        *(T + 2.25, 0.275, 0.5, 0.325, 0.8),
    ]


def test_read_deepstream_object_without_tracker_is_omitted():
    message = samples.DEEPSTREAM_FULL.replace(b'"id": "7"', b'"id": "18446744073709551615"')
    assert READERS["deepstream_full"][1](message) == []


@pytest.mark.parametrize("kind", ["vehicle", "Car"])
def test_read_deepstream_full_schema_takes_the_class_from_its_field(kind):
    message = samples.DEEPSTREAM_FULL.replace(b'"person"', f'"{kind}"'.encode())
    (found,) = READERS["deepstream_full"][1](message)
    assert found.label == kind


@pytest.mark.parametrize(
    ("message", "needed"),
    [
        (b'{"objects": [], "time": 1}', "`frame`, `path` or `observations` is needed, got the fi"),
        (
            b'{"detections": [], "timestamp": "2026-11-20T08:00:00Z"}',
            "^channel_id of axis.scene.frame_v1: a",
        ),
    ],
)
def test_read_axis_rejects_unknown_message_with_its_fields(message, needed):
    with pytest.raises(MessageError, match=needed):
        axis.read_message(message, {1: "yard"})


# The good row is the sample's own; the bad one is beside it.
_BAD_ROWS = {
    "axis": ("detections", {"object_track_id": None, "bounding_box": {"left": 0}}),
    "axis_beta": ("frame/observations", {"track_id": None, "bounding_box": {"left": 0}}),
    "frames": ("detections", {"id": None, "box": [1, 2, 3, 4]}),
    "deepstream": ("objects", "7|480"),
    "ultralytics_summary": ("", {"track_id": 8, "name": "person"}),
    "supervision_json": ("", {"tracker_id": 8, "frame_number": 5}),
}


@pytest.mark.parametrize("source", _BAD_ROWS)
def test_bad_row_is_skipped_and_the_others_are_read(source):
    message, read = READERS[source]
    place, row = _BAD_ROWS[source]
    document = json.loads(message)
    rows = document
    for name in filter(None, place.split("/")):
        rows = rows[name]
    rows.insert(0, row)
    found = list(read(json.dumps(document).encode()))
    (person,) = [each for each in found if isinstance(each, Detection)]
    assert shares(person) == pytest.approx(PLACE, abs=1e-6)
    (skipped,) = [each for each in found if isinstance(each, SkippedRow)]
    assert skipped.code == "malformed"
    assert skipped.detail.startswith(f"{place or 'rows'}/0")


def test_bad_object_of_onvif_is_skipped_and_the_others_are_read():
    message = samples.ONVIF_XML.replace(b'<tt:Object ObjectId="9"/>', _ONVIF_BAD)
    found = READERS["onvif_xml"][1](message)
    (person,) = [each for each in found if isinstance(each, Detection)]
    assert shares(person) == pytest.approx(PLACE, abs=1e-6)
    assert [each.code for each in found if isinstance(each, SkippedRow)] == ["malformed"]


_ONVIF_BAD = b"""<tt:Object ObjectId=""><tt:Appearance><tt:Shape>
 <tt:BoundingBox left="1" top="2" right="3" bottom="4"/></tt:Shape></tt:Appearance></tt:Object>"""


def test_bad_event_of_frigate_is_skipped_and_the_others_are_read():
    bad = b'[{"id": "2", "label": null}, ' + samples.FRIGATE_STORED[1:]
    first, second = frigate.read_stored(bad)
    assert isinstance(first, SkippedRow)
    assert second.id == "1.5-a"


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (b"<MetadataStream>", b"</MetadataStream>"),
        (b'<s:Envelope xmlns:s="http://www.w3.org/2003/05/soap-envelope"><s:Body>'
         b"<wsnt:Notify><wsnt:Message>", b"</wsnt:Message></wsnt:Notify></s:Body></s:Envelope>"),
    ],
)  # fmt: skip
def test_read_onvif_xml_finds_frames_in_envelopes(before, after):
    declaration, _, stream = samples.ONVIF_XML.partition(b"\n")
    for message in (before + stream + after, b"\xef\xbb\xbf \n" + declaration + stream):
        found = onvif.read_xml(message, "yard", Profile.TRANSFORMED)
        (person,) = [each for each in found if isinstance(each, Detection)]
        assert shares(person) == pytest.approx(PLACE, abs=1e-6)
        assert [each.track_id for each in found if isinstance(each, Ended)] == ["3", "4"]


@pytest.mark.parametrize(
    "wrapped",
    [
        lambda frames: {"MetadataStream": {"VideoAnalytics": {"Frame": frames}}},
        lambda frames: {"tt:MetadataStream": {"tt:VideoAnalytics": [{"tt:Frame": frames}]}},
        lambda frames: {"Topic": "x", "Data": {"Envelope": {"Body": {"Frame": frames[0]}}}},
    ],
)
def test_read_onvif_json_finds_frames_in_envelopes(wrapped):
    frames = json.loads(samples.ONVIF_JSON)["Frame"]
    message = json.dumps(wrapped(frames)).encode()
    assert onvif.read_json(message, "yard", Profile.TRANSFORMED) == READERS["onvif_json"][1](
        samples.ONVIF_JSON
    )


def test_onvif_without_a_frame_is_rejected_unless_it_has_events_alone():
    event = b"<MetadataStream><Event><NotificationMessage/></Event></MetadataStream>"
    assert onvif.read_xml(event, "yard", Profile.NORMALISED) == []
    with pytest.raises(MessageError, match=r"a Frame is needed, got Fault, text"):
        onvif.read_json(b'{"Fault": {"text": 1}}', "yard", Profile.NORMALISED)


@pytest.mark.parametrize("source", ["axis", "axis_beta", "onvif_xml"])
def test_ends_and_renames_end_a_track(source):
    message, read = READERS[source]
    ended = [found.track_id for found in read(message) if isinstance(found, Ended)]
    assert ended == (["c3", "d4"] if source == "axis" else ["3", "4"])


def test_onvifs_own_sample_counts_its_pixels_upwards():
    message, read = READERS["onvif_json"]
    (person,) = read(message)
    assert person.box == pytest.approx((20 / 640, 1 - 80 / 480, 100 / 640, 1 - 30 / 480), abs=1e-5)
    assert (person.track_id, person.label, person.size) == ("15", "Human", NORMALISED)
    # A time without its zone is UTC.
    assert person.time_s == datetime(2021, 10, 5, 15, 13, 27, 321_000, tzinfo=UTC).timestamp()


@pytest.mark.parametrize(
    ("profile", "edges", "transformation"),
    [
        (Profile.NORMALISED, (-0.5, 0.0, -0.4, -0.5), True),  # which does not apply
        (Profile.NORMALISED, (-0.5, 0.0, -0.4, -0.5), False),
        (Profile.GRID, (2048, 4096, 2457.6, 6144), False),
    ],
)
def test_what_a_box_is_of_is_declared(profile, edges, transformation):
    document = json.loads(samples.ONVIF_JSON)
    (frame,) = document["Frame"]
    names = ("@left", "@top", "@right", "@bottom")
    box = dict(zip(names, edges, strict=True))
    frame["Object"][0]["Appearance"]["Shape"]["BoundingBox"] = box
    if not transformation:
        del frame["Transformation"]
    document["Frame"] = frame  # without its list, as some send it
    (person,) = onvif.read_json(json.dumps(document).encode(), "yard", profile)
    assert person.box == pytest.approx(PLACE)


def test_a_wrong_profile_is_told():
    message = re.sub(
        rb"<tt:Transformation>.*</tt:Transformation>", b"", samples.ONVIF_XML, flags=16
    )
    with pytest.raises(MessageError, match=r"Transformation: one is needed"):
        onvif.read_xml(message, "yard", Profile.TRANSFORMED)


def test_xml_with_entities_is_refused_by_name():
    bomb = b'<!DOCTYPE a [<!ENTITY b "bbbb"><!ENTITY c "&b;&b;">]><a>&c;</a>'
    with pytest.raises(MessageError) as refused:
        onvif.read_xml(bomb, "yard", Profile.NORMALISED)
    assert refused.value.code == "unsupported"


def test_frames_of_channels_that_are_nobodys_are_empty():
    assert axis.read_message(samples.AXIS, {2: "yard"}) == []


@pytest.mark.parametrize("last", ["7", "0.87", ""])
def test_ultralytics_six_columns_end_in_an_id_or_a_confidence(last):
    found = rows.read_ultralytics_text(f"0 .5 .5 .1 .1 {last}".encode(), "yard", T)
    assert [each.track_id for each in found] == (["7"] if last == "7" else [])


def test_frames_of_a_camera_become_tracks():
    assembler = Assembler()
    for n in range(6):
        message = samples.AXIS.replace(b"00.250000Z", f"0{n}.250000Z".encode())
        for found in axis.read_message(message, {1: "yard"}):
            assembler.add(found, n)
    assembler.finish_all()
    (track,) = assembler.take()
    assert (track.track_id, len(track.rows) // 5, track.size) == ("a1b2", 6, NORMALISED)


@pytest.mark.parametrize("source", READERS)
def test_a_message_beyond_all_measure_is_refused_before_it_is_read(source):
    most = rows.MAX_FILE_BYTES if source.startswith("supervision") else MAX_MESSAGE_BYTES
    with pytest.raises(MessageError) as refused:
        READERS[source][1](b" " * (most + 1))
    assert refused.value.code == "too_large"


@pytest.mark.parametrize("source", [name for name in ALL_READERS if _is_json(name)])
@pytest.mark.parametrize("levels", [33, 900, 5_000])
def test_json_nested_too_deeply_is_rejected_before_it_is_parsed(source, levels):
    nested = b"[" * (levels - 1) + b"]" * (levels - 1)
    with pytest.raises(MessageError) as refused:
        list(ALL_READERS[source][1](b'{"x": "[[", "y":' + nested + b"}"))
    assert (refused.value.code, str(levels) in refused.value.detail) == ("too_deep", True)


def test_xml_nested_too_deeply_is_rejected():
    with pytest.raises(MessageError, match="at most 32 nested levels"):
        onvif.read_xml(b"<a>" * 5_000 + b"</a>" * 5_000, "yard", Profile.NORMALISED)


@pytest.mark.parametrize("source", ALL_READERS)
@pytest.mark.parametrize(
    "message",
    [
        b"",
        b"{",
        b"[" * 100_000,
        b'{"x":' + b"[" * 5_000 + b"]" * 5_000 + b"}",
        b"{}",
        b"[]",
        b"\xff\xfe",
        b"null",
        b'"x"',
        b"<a" * 1000,
        b"<a/>",
    ],
)
def test_what_is_no_message_is_refused_by_name_or_empty(source, message):
    read_or_refused(source, message)


def read_or_refused(source, message):
    """Numbers of whatever is read are finite, and whatever is not read has a code."""
    found, refused = [], None
    try:
        found = ALL_READERS[source][1](message)
    except MessageError as error:
        refused = error
    if refused is not None:
        assert refused.code in ("malformed", "not_finite", "too_deep", "too_large", "unsupported")
        assert 1 <= len(refused.detail) <= MAX_DETAIL
    for each in found:
        if isinstance(each, SkippedRow):
            assert each.code in ("malformed", "not_finite", "unsupported")
            continue
        assert 1 <= len(each.track_id) <= 200
        if isinstance(each, Detection):
            assert all(map(math.isfinite, (each.time_s, *each.box)))
        elif isinstance(each, WholeTrack):
            assert len(each.rows) >= 3
            assert all(map(math.isfinite, each.rows))


_LEAVES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(allow_nan=False, allow_infinity=False),
    st.text(max_size=5),
    st.sampled_from(["nan", "1e999", "9" * 400, "\0", "2026-02-30T00:00:00Z", "0001-01-01"]),
)
_VALUES = st.recursive(
    _LEAVES,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=6,
)


def _places(value, path=()):
    yield path
    keys = value if isinstance(value, dict) else range(len(value)) if type(value) is list else ()
    for key in keys:
        yield from _places(value[key], (*path, key))


@pytest.mark.parametrize(
    "source",
    [
        "axis",
        "axis_beta",
        "axis_consolidated",
        "onvif_json",
        "deepstream",
        "deepstream_full",
        "frames",
        "supervision_json",
        "ultralytics_summary",
        "frigate",
        "frigate_stored",
    ],
)
@given(data=st.data())
def test_json_with_anything_anywhere(source, data):
    document = json.loads(ALL_READERS[source][0])
    path = data.draw(st.sampled_from([each for each in _places(document) if each]))
    inside = document
    for key in path[:-1]:
        inside = inside[key]
    inside[path[-1]] = data.draw(_VALUES)
    read_or_refused(source, json.dumps(document).encode())


@pytest.mark.parametrize("source", ALL_READERS)
@given(data=st.data())
def test_bytes_that_were_changed_cut_or_repeated(source, data):
    message = ALL_READERS[source][0]
    begin, end = sorted(data.draw(st.tuples(*[st.integers(0, len(message))] * 2)))
    between = data.draw(st.binary(max_size=8) | st.just(message[begin:end] * 2))
    read_or_refused(source, message[:begin] + between + message[end:])
