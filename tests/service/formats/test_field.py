"""Files as users have sent them, with the people and the feet that are in them."""

import json

import pytest
from sqlalchemy import select

import surefoot
from service.store.engines.store import Store
from service.store.tracks import TrackRecord, unpack
from surefoot.bridge.frames import read_frame
from surefoot.bridge.values import MessageError
from tests.conftest import CAMERA, SCENES, track
from tests.service.conftest import problem

FIELD = SCENES.parent / "field"
needs_field = pytest.mark.skipif(not FIELD.is_dir(), reason=f"no files in {FIELD}")
CSV, JSON = "text/csv", "application/json"
# By file: its form, people, skipped tracks, the id and the foot of the first track.
FILES = {
    "blanks_between.txt": (CSV, 1, {}, "7", (339.0, 499.0)),
    "boxmot_conf_in_column_nine.txt": (CSV, 1, {"not_a_person": 2}, "100", (239.0, 499.0)),
    "header_names_corners.csv": (CSV, 1, {}, "7", (340.0, 500.0)),
    "mcmot_ten_columns.txt": (CSV, 1, {"not_a_person": 1}, "1", (339.0, 499.0)),
    "class_as_text.json": (JSON, 1, {}, "1", (300.0, 500.0)),
}


@pytest.fixture
def hall(http):
    """A camera whose image holds the boxes of all files."""
    lens = {**CAMERA["intrinsics"], "width": 1920, "height": 1080, "cx": 959.5, "cy": 539.5}
    http.post("/cameras", json={**CAMERA, "id": "hall", "intrinsics": lens}).raise_for_status()
    return http


@needs_field
@pytest.mark.parametrize("name", FILES)
def test_field_file_has_its_people_at_their_feet(hall, settings, name):
    kind, people, skipped, track_id, foot = FILES[name]
    body = (FIELD / name).read_bytes()
    given = {"started_at": "2026-11-20T08:00:00Z", "frame_rate_hz": 25}
    if kind == JSON:  # it is of a later day than today
        tracks = json.loads(body)["tracks"]
        for each in tracks:
            each["points"] = [[time_s - 1e8, u, v] for time_s, u, v in each["points"]]
        body, given = json.dumps({"tracks": tracks}).encode(), {}
    answer = hall.post(
        "/cameras/hall/tracks", params=given, content=body, headers={"Content-Type": kind}
    )
    assert answer.status_code == 202, answer.text
    assert answer.json()["accepted"] == people
    assert answer.json().get("skipped", {}) == skipped
    assert answer.json()["rejected"] == []
    with Store(settings).read() as session:
        first = session.scalars(select(TrackRecord).order_by(TrackRecord.id)).first()
        assert first.track_id == track_id
        assert tuple(unpack(first.points, 3)[0, 1:]) == foot
    if kind == CSV:
        (read,) = surefoot.read_tracks(FIELD / name, frame_rate_hz=25)
        assert tuple(read.uv[0]) == foot


@needs_field
def test_frame_with_class_number_is_a_person():
    (seen,) = read_frame((FIELD / "frame_with_class_number.json").read_bytes(), "hall")
    assert (seen.label, seen.box) == ("person", (300.0, 100.0, 380.0, 400.0))


def test_frame_in_milliseconds_gets_the_text_of_a_post(corner):
    time_ms = 1_795_766_400_000.0
    message = {"time_s": time_ms, "detections": []}
    with pytest.raises(MessageError) as refused:
        read_frame(json.dumps(message).encode(), "corner")
    reason = "must be seconds since 1970; the value looks like milliseconds, got 1795766400000.000"
    assert (refused.value.code, refused.value.detail) == ("malformed", f"time_s: {reason}")
    late = track("1", start_s=time_ms)
    document = problem(corner.post("/cameras/corner/tracks", json={"tracks": [late]}), 422,
                       "nothing_taken")  # fmt: skip
    assert document["errors"][0]["reason"] == f"time_out_of_range: points/0/0: {reason}"


WALK = "\n".join(f"{1 + 12 * n},7,{300 + n},51,40,150,1" for n in range(6))


@pytest.mark.parametrize(
    ("given", "hour"),
    [
        ("2026-11-20T08:00:00%2B02:00", 6),
        ("2026-11-20T08:00:00+02:00", 6),  # the + arrives as a blank
        ("2026-11-20T08:00+0200", 6),
        ("2026-11-20T08:00:00.5-02:00", 10),
    ],
)
def test_zone_whose_plus_became_a_blank_is_read(corner, settings, given, hour):
    address = f"/cameras/corner/tracks?frame_rate_hz=25&started_at={given}"
    corner.post(address, content=WALK, headers={"Content-Type": CSV}).raise_for_status()
    with Store(settings).read() as session:
        started_s = session.scalars(select(TrackRecord)).one().started_s
    assert int(started_s) // 3600 % 24 == hour
    history = "/cameras/corner/pose/history"
    assert corner.get(f"{history}?from={given}").status_code == 200


@pytest.mark.parametrize("given", ["2026-11-20 08:00:00", "2026-11-20T08:00:00", "today", "1 2"])
def test_time_without_zone_is_refused_with_an_example(corner, given):
    posted = corner.post(
        f"/cameras/corner/tracks?frame_rate_hz=25&started_at={given}",
        content=WALK,
        headers={"Content-Type": CSV},
    )
    for answer in (posted, corner.get(f"/cameras/corner/pose/history?from={given}")):
        document = problem(answer, 422, "malformed")
        assert "must be an RFC 3339 time with a zone, for example" in document["detail"]
        assert repr(given) in document["detail"]


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"fx": -5}, "must be at least 1 (got -5)"),
        ({"fx": 1e9}, "must be at most 1000000 (got 1000000000)"),
        ({"fx": "wide"}, "must be a number (got 'wide')"),
        ({"fx": None}, "must be a number (got None)"),
    ],
)
def test_bad_fx_is_one_error_with_limit_and_value(http, change, reason):
    body = {**CAMERA, "intrinsics": {**CAMERA["intrinsics"], **change}}
    document = problem(http.post("/cameras", json=body), 422, "malformed")
    assert document["errors"] == [{"pointer": "/intrinsics/fx", "reason": reason}]
    assert document["detail"] == f"intrinsics/fx: {reason}"


def test_missing_fx_is_named(http):
    lens = {name: value for name, value in CAMERA["intrinsics"].items() if name != "fx"}
    document = problem(http.post("/cameras", json={**CAMERA, "intrinsics": lens}), 422, "malformed")
    assert {"pointer": "/intrinsics/fx", "reason": "is required"} in document["errors"]
