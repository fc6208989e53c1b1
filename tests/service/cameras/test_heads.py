"""Points that carry heads: stored as posted, read as verticals, and refused by name."""

import json

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from sqlalchemy import select

from service.store import tracks
from service.store.cameras import CameraRecord
from service.store.engines.store import Store
from service.store.tracks import TrackRecord, seen_of, trajectory_of, unpack
from tests.conftest import track
from tests.service.conftest import problem

T0 = 1_700_000_000.0
POINTS = [[T0 + 0.5 * n, 600.1 + 9 * n, 520.3, 590.7 + 9 * n, 310.9 - n] for n in range(6)]


def headed(name="h", **changed):
    """A track with heads; rows by their index changed."""
    rows = [list(row) for row in POINTS]
    for at, row in changed.items():
        rows[int(at[1:])] = row
    return {"id": name, "points": rows}


def refusal(http, bad):
    answer = http.post("/cameras/corner/tracks", json={"tracks": [track("good"), bad]})
    assert answer.status_code == 202
    assert answer.json()["accepted"] + answer.json()["duplicates"] == 1
    (rejection,) = answer.json()["rejected"]
    return rejection["code"], rejection["detail"]


def test_heads_are_stored_as_posted_beside_their_feet(corner, settings):
    body = {"tracks": [headed(), track("without")]}
    assert corner.post("/cameras/corner/tracks", json=body).json()["accepted"] == 2
    with Store(settings).read() as session:
        record, bare = session.scalars(select(TrackRecord).order_by(TrackRecord.id))
        assert_array_equal(unpack(record.points, 3), np.array(POINTS)[:, :3])
        assert_array_equal(unpack(record.heads, 2), np.array(POINTS)[:, 3:])
        assert (record.boxes, bare.heads) == (None, None)
        size = len(record.points) + len(record.heads) + len(bare.points)
        assert sum(tracks.stored_bytes(session, "corner")[1].values()) == size
        lens = session.get(CameraRecord, "corner").intrinsics
        seen = seen_of(record, trajectory_of(record), lens)
        assert_array_equal(seen.head_uv, np.array(POINTS)[:, 3:])
        assert_array_equal(seen.top_v, np.array(POINTS)[:, 4])
        assert seen_of(bare, trajectory_of(bare), lens).head_uv is None


def test_a_head_cut_by_the_picture_is_no_top(corner, settings):
    cut = headed(_2=[T0 + 1, 618.1, 520.3, 608.7, 0.5])
    assert corner.post("/cameras/corner/tracks", json={"tracks": [cut]}).json()["accepted"] == 1
    with Store(settings).read() as session:
        record = session.scalars(select(TrackRecord)).one()
        lens = session.get(CameraRecord, "corner").intrinsics
        seen = seen_of(record, trajectory_of(record), lens)
    assert np.isnan(seen.top_v).tolist() == [False, False, True, False, False, False]


def test_frames_carry_heads_too(corner, settings):
    rows = [[n * 20, *POINTS[n][1:]] for n in range(6)]
    body = {"tracks": [{"id": "f", "frames": rows}], "frame_rate_hz": 10, "started_at": T0}
    assert corner.post("/cameras/corner/tracks", json=body).json()["accepted"] == 1
    with Store(settings).read() as session:
        record = session.scalars(select(TrackRecord)).one()
        assert_array_equal(unpack(record.points, 3)[:, 0], T0 + 2.0 * np.arange(6))
        assert_array_equal(unpack(record.heads, 2), np.array(POINTS)[:, 3:])


@pytest.mark.parametrize("form", ["points", "frames"])
def test_all_points_of_a_track_carry_a_head_or_none(corner, form):
    mixed = headed(_3=POINTS[3][:3])
    code, detail = refusal(corner, {"id": "m", form: mixed["points"]})
    assert code == "malformed"
    assert detail.startswith(f"{form}/3: 5, as in the first point: all points carry a head or none")
    assert str(POINTS[3][:3]) in detail
    other = headed(_0=POINTS[0][:3])
    assert refusal(corner, {"id": "o", form: other["points"]})[1].startswith(f"{form}/1: 3, as in")
    four = headed(_0=POINTS[0][:4])
    assert "points/0: 3 or 5 numbers are needed" in refusal(corner, four)[1]


@pytest.mark.parametrize(
    ("row", "code", "said"),
    [
        ([*POINTS[2][:4], 520.3], "malformed", "v_head below 520.3, is needed, got 520.3"),
        ([*POINTS[2][:4], 600.0], "malformed", "points/2/4: a head above its foot"),
        ([*POINTS[2][:3], None, 300.0], "not_finite", "points/2: numbers are needed"),
        ([*POINTS[2][:3], 2600.0, 300.0], "outside_image", "heads of points/2: u from -1280"),
        ([*POINTS[2][:3], 600.0, -721.0], "outside_image", "v from -720 to 1440 px"),
    ],
)
def test_heads_that_nobody_carries_are_refused_by_field_limit_and_value(corner, row, code, said):
    found, detail = refusal(corner, headed(_2=row))
    assert found == code
    assert said in detail


def test_a_body_of_bad_heads_alone_is_a_problem(corner):
    answer = corner.post("/cameras/corner/tracks", json={"tracks": [headed(_2=POINTS[2][:3])]})
    document = problem(answer, 422, "nothing_taken")
    assert document["errors"][0]["pointer"] == "/tracks/0"


def test_not_a_number_is_refused(corner):
    body = json.dumps({"tracks": [track("good"), headed()]}).replace("310.9]", "NaN]", 1)
    answer = corner.post(
        "/cameras/corner/tracks", content=body, headers={"Content-Type": "application/json"}
    )
    assert answer.json()["rejected"][0]["code"] == "not_finite"
