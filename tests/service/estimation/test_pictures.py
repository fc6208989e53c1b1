"""A picture beside the people, or alone: one tells a knock, and that a camera stands."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from io import BytesIO
from math import radians

import cv2
import numpy as np
import pytest
from fastapi.testclient import TestClient
from PIL import Image
from sqlalchemy import func, select

from service.api import aim as aim_route
from service.app import create_app
from service.notifications.fetch import Fetched, FetchError
from service.store import cameras
from service.store.cameras import SnapshotRecord
from service.store.pictures import PictureRecord, PictureReferenceRecord
from service.workers.upkeep import snapshots
from tests.conftest import CAMERA
from tests.models.pictures.given import seen_after, wall
from tests.service.conftest import problem
from tests.service.street import KNOCKED, LENS, PRIOR, Street, known_street

SCENE = wall(lens=LENS)
TURNED = replace(PRIOR, tilt_rad=PRIOR.tilt_rad + radians(3), heading_rad=radians(44))
PATH = "/cameras/corner/snapshot"


@pytest.fixture(params=["pictures"])
def http(request, settings):
    settings = settings.model_copy(update={"snapshots": request.param})
    with TestClient(create_app(settings)) as client:
        client.settings = settings
        yield client


def picture(pose=PRIOR, seed=7, gain=1.0, grey=None):
    """The picture that a camera takes at a pose, with some noise of its own, as a PNG."""
    grey = seen_after(SCENE, PRIOR, pose, LENS) if grey is None else grey
    noise = np.random.default_rng(seed).normal(0, 2, grey.shape)
    made = BytesIO()
    Image.fromarray(np.clip(grey * gain + noise, 0, 255).astype(np.uint8)).save(made, "PNG")
    return made.getvalue()


def take(http, pose=PRIOR, *, before_s=0.0, gain=1.0, grey=None, seed=None):
    """Send a picture."""
    made = picture(pose, seed or round(before_s * 10) + 7, gain, grey)
    at = datetime.now(UTC) - timedelta(seconds=before_s)
    answer = http.put(
        PATH,
        content=made,
        headers={"Content-Type": "image/png"},
        params={"taken_at": at.isoformat()},
    )
    return answer.raise_for_status().json()


def rows(street, record):
    with street.context.store.read() as session:
        return session.scalar(select(func.count()).select_from(record))


def test_a_knock_is_told_by_one_picture_with_nobody_in_sight(http):
    http.post("/cameras", json=CAMERA).raise_for_status()
    line = {"zones": [{"id": "gate", "points": [[300, 500], [900, 500]]}]}
    http.put("/cameras/corner/zones", json=line, headers={"If-Match": "*"}).raise_for_status()
    street = Street(http, http.settings)
    take(http, before_s=7200)
    assert street.look()["state"] == "unconnected"
    take(http, before_s=3600, gain=0.8)
    still = street.look()
    assert (still["state"], still["reason_code"]) == ("ok", "by_picture")
    assert still["estimates"]["picture"]["tilt_deg"] == pytest.approx(0.0, abs=0.05)
    assert street.alerts() == []
    take(http, TURNED)
    found = street.look()
    (alert,) = street.alerts()
    assert (alert["kind"], alert["drift"]["height_m"]) == ("drift", None)
    assert alert["drift"]["tilt_deg"] == pytest.approx(3.0, abs=0.1)
    assert alert["drift"]["heading_deg"] == pytest.approx(4.0, abs=0.1)
    assert alert["reason_code"] == "by_picture"
    assert found["state"] == "drifting"
    evidence = http.get(f"/alerts/{alert['id']}/evidence").raise_for_status().json()
    assert (evidence["tracks"], evidence["offset_sd"]["height_m"]) == (0, None)
    (gate,) = http.get(f"/alerts/{alert['id']}").json()["zones"]
    assert gate["overlap"] < 0.1
    assert (gate["crossed"], gate["missed"]) == (0, 0)  # nobody has come
    seen = found["estimates"]["picture"]
    assert seen["matched"]
    assert seen["tilt_deg"] == pytest.approx(3.0, abs=0.1)
    assert seen["zoom"] == pytest.approx(1.0, abs=0.005)
    # And one more tells that it was put back.
    take(http)
    assert street.look()["state"] == "ok"
    assert [each["state"] for each in street.alerts()] == ["resolved"]


def turned_by(tilt, roll, heading):
    """The prior pose, turned by so many degrees."""
    return replace(
        PRIOR,
        tilt_rad=PRIOR.tilt_rad + radians(tilt),
        roll_rad=PRIOR.roll_rad + radians(roll),
        heading_rad=PRIOR.heading_rad + radians(heading),
    )


def test_three_images_of_a_turn_of_1_3_deg_in_three_angles_open_an_alert(http):
    """Each angle is below the floor of 1 deg, and the whole turn is beyond it."""
    http.post("/cameras", json=CAMERA).raise_for_status()
    street = Street(http, http.settings)
    states, compared, after = [], [], turned_by(0.75, 0.5, 0.75)
    for hours, pose in enumerate([PRIOR, PRIOR, after, after, after]):
        take(http, pose, before_s=3600 * (5 - hours), gain=1 - 0.05 * hours)
        found = street.look()
        states.append(found["state"])
        compared.append(found["estimates"].get("picture", {}).get("compared"))
    assert states == ["unconnected", "ok", "drifting", "drifting", "drifting"]
    assert compared == [None, 1, 2, 3, 4]
    seen = found["estimates"]["picture"]
    turn = [seen[name] for name in ("tilt_deg", "roll_deg", "heading_deg")]
    assert turn == pytest.approx([0.75, 0.5, 0.75], abs=0.06)
    assert (seen["matched"], seen["inliers"] > 100) == (True, True)
    (alert,) = street.alerts()
    assert (alert["kind"], alert["state"]) == ("drift", "firing")
    assert alert["drift"]["angle_deg"] == pytest.approx(1.29, abs=0.05)
    assert found["moved"] > 0.9999
    with street.context.store.read() as session:
        matches = session.get_one(PictureRecord, "corner").matches
    assert len(matches) == 4
    assert matches[0]["taken_s"] > matches[3]["taken_s"]


def test_images_of_a_camera_that_did_not_move_open_no_alert(http):
    """Another light, noise and a shift of 0.2 px; then an image of another scene."""
    http.post("/cameras", json=CAMERA).raise_for_status()
    street, scene = Street(http, http.settings), SCENE.astype(np.float32)
    shifted = cv2.warpAffine(
        scene, np.float32([[1, 0, 0.2], [0, 1, 0.2]]), scene.shape[::-1], flags=cv2.INTER_CUBIC
    )
    blurred = cv2.GaussianBlur(scene, (0, 0), 1.5)
    for hours, grey in enumerate([scene, shifted, blurred, 0.6 * scene, 30 + 0.8 * scene]):
        take(http, before_s=3600 * (9 - hours), grey=grey)
        found = street.look()
    assert (found["state"], street.alerts()) == ("ok", [])
    assert found["moved"] < 0.05
    take(http, before_s=60, grey=wall(1, LENS))
    found = street.look()
    assert found["estimates"]["picture"] | {"taken_at": None} == dict.fromkeys(
        ("taken_at", "tilt_deg", "roll_deg", "heading_deg", "zoom", "sd", "shifted", "inliers")
    ) | {"matched": False, "compared": 5}
    assert found["state"] == "ok"  # no match is no evidence
    assert [each["kind"] for each in street.alerts() if each["kind"] != "picture"] == []


def test_images_that_never_match_are_reported(http):
    http.post("/cameras", json=CAMERA).raise_for_status()
    street = Street(http, http.settings)
    take(http, before_s=7200)
    street.look()
    take(http, before_s=3600, grey=wall(1, LENS))
    found = street.look()
    assert (found["state"], found["reason_code"]) == ("learning", "awaiting_image")
    assert found["reason"].startswith("1 image was compared")


def test_images_within_a_minute_count_once(http):
    http.post("/cameras", json=CAMERA).raise_for_status()
    street = Street(http, http.settings)
    for before_s in (300, 200, 190, 180, 60):
        take(http, before_s=before_s)
        street.look()
    with street.context.store.read() as session:
        record = session.get_one(PictureRecord, "corner")
        ages = [record.matches[0]["taken_s"] - each["taken_s"] for each in record.matches]
    assert ages == pytest.approx([0, 140], abs=30)


def test_a_picture_tells_a_knock_before_people_do_and_since_when(http):
    street = known_street(http, http.settings, 60)
    street.keep_to_lanes(PRIOR, 30)
    take(http, before_s=7200)
    assert street.look()["state"] == "ok"
    take(http, before_s=3600)
    before = street.look()
    assert before["estimates"]["picture"]["matched"]
    take(http, TURNED, before_s=60)
    found = street.look()
    assert found["state"] == "drifting"
    assert found["drift"]["tilt_deg"] == pytest.approx(3.0, abs=0.1)
    since = found["since"]
    assert since["after"] == before["estimates"]["picture"]["taken_at"].replace("+00:00", "Z")
    assert since["before"] == found["estimates"]["picture"]["taken_at"].replace("+00:00", "Z")


def test_a_camera_that_was_moved_aside_is_said_to_be(http):
    """Near things, below, are further aside than far ones, above: no turn does that."""
    street = known_street(http, http.settings, 60)
    take(http, before_s=7200)
    assert "moved aside" not in str(street.look())
    rows_ = np.arange(LENS.height, dtype=np.float32)
    aside = LENS.width / 640 * (12 + np.maximum(rows_ - LENS.height / 3, 0) / LENS.height * 60)
    u, v = np.meshgrid(np.arange(LENS.width, dtype=np.float32), rows_)
    take(http, grey=cv2.remap(SCENE, u + aside[:, None].astype(np.float32), v, cv2.INTER_LINEAR))
    found = street.look()
    assert found["estimates"]["picture"]["shifted"]
    assert "moved aside" in str(found), found


def test_a_picture_that_says_it_stands_makes_other_paths_a_changed_site(http):
    street = known_street(http, http.settings, 60)
    take(http, before_s=7200)
    street.look()
    take(http, before_s=7100)
    street.keep_to_lanes(PRIOR, 20)
    street.look()
    street.clock_s += 12_000
    street.keep_to_lanes(KNOCKED, 40)
    take(http)
    found = street.look()
    assert found["state"] == "ok"
    assert found["reason_code"] == "site_changed"
    assert street.alerts() == []
    # It is kept how people compare with pictures.
    assert "people said that one moved 1 time (50.0 %)" in http.get("/ui/health").text


def test_a_picture_of_before_the_people_counts_no_more(http):
    street = known_street(http, http.settings, 60)
    take(http, before_s=19_000)
    street.look()
    take(http, before_s=18_000, seed=4)
    street.look()
    street.clock_s += 5_000
    street.keep_to_lanes(KNOCKED, 60)
    take(http, seed=4)  # the same to the last pixel: frozen
    assert street.look()["state"] == "drifting"
    assert [each["kind"] for each in street.alerts()] == ["drift", "picture"]


@pytest.mark.parametrize("http", ["features"], indirect=True)
def test_features_alone_are_kept_where_the_setting_says_so(http):
    http.post("/cameras", json=CAMERA).raise_for_status()
    street = Street(http, http.settings)
    take(http, before_s=3600)
    street.look()
    assert (rows(street, SnapshotRecord), rows(street, PictureReferenceRecord)) == (0, 1)
    problem(http.get(PATH), 404, "not_found")
    take(http, TURNED)
    street.look()
    assert [each["kind"] for each in street.alerts()] == ["drift"]
    assert (rows(street, SnapshotRecord), rows(street, PictureRecord)) == (0, 1)
    http.delete("/cameras/corner", headers={"If-Match": "*"}).raise_for_status()
    assert rows(street, PictureReferenceRecord) == rows(street, PictureRecord) == 0


def test_the_light_of_a_night_joins_once_it_was_seen_to_stand_before_and_after(http):
    http.post("/cameras", json=CAMERA).raise_for_status()
    street, night = Street(http, http.settings), 255 - seen_after(SCENE, PRIOR, PRIOR, LENS)
    matched = []
    for hours, grey in enumerate([None, None, night, night, None, night]):
        take(http, before_s=3600 * (6 - hours), grey=grey)
        street.look()
        with street.context.store.read() as session:
            matched.append(session.get_one(PictureRecord, "corner").offset is not None)
    assert matched == [False, True, False, False, True, True]
    take(http, grey=255 - seen_after(SCENE, PRIOR, TURNED, LENS))
    street.look()
    assert street.alerts()[0]["drift"]["tilt_deg"] == pytest.approx(3.0, abs=0.1)


def test_what_is_wrong_with_a_picture_is_an_alert_of_its_own(http):
    http.post("/cameras", json=CAMERA).raise_for_status()
    street = Street(http, http.settings)
    take(http, before_s=7200)
    street.look()
    take(http, before_s=3600, grey=np.full((720, 1280), 4, np.uint8))
    street.look()
    (alert,) = street.alerts()
    assert (alert["kind"], alert["reason_code"]) == ("picture", "picture_black")
    take(http)
    street.look()
    assert [each["state"] for each in street.alerts()] == ["resolved"]


def test_an_older_picture_than_the_newest_is_refused(http):
    http.post("/cameras", json=CAMERA).raise_for_status()
    take(http, before_s=60)
    made = BytesIO()
    Image.new("L", (1280, 720)).save(made, "PNG")
    at = (datetime.now(UTC) - timedelta(seconds=90)).isoformat()
    answer = http.put(
        PATH,
        content=made.getvalue(),
        headers={"Content-Type": "image/png"},
        params={"taken_at": at},
    )
    assert "a newer picture is kept" in problem(answer, 409, "conflict")["detail"]


def test_a_camera_is_asked_for_its_picture_and_at_once_in_doubt(http, monkeypatch):
    seen = {"pose": PRIOR, "asked": 0}

    def fetched(*_):
        seen["asked"] += 1
        if seen["pose"] is None:
            raise FetchError("answered 500")
        return Fetched(content=picture(seen["pose"]), media_type="image/png")

    monkeypatch.setattr(snapshots, "fetch_image", fetched)
    fetching = snapshots.SnapshotRounds()

    def rounds(street):
        with street.context.store.read() as session:
            due = cameras.snapshots_due(session, datetime.now(UTC), timedelta(hours=1))
        for each in due:
            fetching.fetch(street.context, each.camera_id)
        return len(due)

    street = known_street(http, http.settings, 60)
    camera = {"snapshot_url": "http://camera.example/now.jpg"}
    http.patch("/cameras/corner", json=camera, headers={"If-Match": "*"}).raise_for_status()
    street.context = replace(street.context, settings=http.settings)
    assert rounds(street) == 1
    street.look()
    assert rounds(street) == 0  # for an hour
    with street.context.store.write() as session:  # it was an hour ago
        record = session.get_one(PictureRecord, "corner")
        record.taken_at = record.same_since = datetime.now(UTC) - timedelta(hours=1)
    street.clock_s += 19_000
    street.keep_to_lanes(KNOCKED, 40)
    seen["pose"] = KNOCKED
    assert street.look()["state"] == "drifting"
    assert rounds(street) == 1
    found = street.look()
    assert found["estimates"]["picture"]["tilt_deg"] == pytest.approx(5.0, abs=0.2)
    # One that does not answer is named, and asked again in ten minutes.
    seen["pose"] = None
    http.patch("/cameras/corner", json=camera, headers={"If-Match": "*"}).raise_for_status()
    assert rounds(street) == 1
    assert http.get("/cameras/corner").json()["snapshot_error"] == "answered 500"
    assert (rounds(street), seen["asked"]) == (0, 3)
    gone = {"snapshot_url": ""}
    after = http.patch("/cameras/corner", json=gone, headers={"If-Match": "*"}).json()
    assert (after["snapshot_url"], after["snapshot_error"]) == (None, None)


def test_who_stands_on_the_ladder_is_told_where_to_turn_it(http, monkeypatch):
    street = known_street(http, http.settings, 60)
    nothing = http.post("/cameras/corner/aim").raise_for_status().json()
    assert (nothing["right_deg"], nothing["by_picture"]) == (None, True)
    street.keep_to_lanes(KNOCKED, 40)
    street.look()
    slow = http.post("/cameras/corner/aim").raise_for_status().json()
    assert (slow["by_picture"], slow["good"]) == (False, False)
    assert slow["up_deg"] == pytest.approx(5.0, abs=0.5)
    assert slow["clockwise_deg"] == pytest.approx(4.0, abs=0.5)
    http.post("/cameras/corner/pose/put-back", json={}).raise_for_status()
    take(http)
    street.look()
    headers = {"Content-Type": "image/png"}
    aim = {"headers": headers, "content": picture(TURNED)}
    found = http.post("/cameras/corner/aim", **aim).raise_for_status().json()
    assert found["up_deg"] == pytest.approx(3.0, abs=0.1)
    # Four degrees of heading are fewer across the picture of a camera that looks down.
    assert found["right_deg"] == pytest.approx(-3.7, abs=0.1)
    assert not found["good"]
    there = {"headers": headers, "content": picture(PRIOR, seed=3)}
    assert http.post("/cameras/corner/aim", **there).json()["good"]
    other = {"headers": headers, "content": picture(grey=wall(1, LENS))}
    assert http.post("/cameras/corner/aim", **other).json()["right_deg"] is None
    assert rows(street, PictureReferenceRecord) == 1
    # Or it is asked of the camera.
    address = {"snapshot_url": "http://camera.example/now.jpg"}
    http.patch("/cameras/corner", json=address, headers={"If-Match": "*"}).raise_for_status()
    asked = Fetched(content=picture(TURNED), media_type="image/png")
    monkeypatch.setattr(aim_route, "fetch_image", lambda *_: asked)
    assert http.post("/cameras/corner/aim").json()["up_deg"] == pytest.approx(3.0, abs=0.1)


def test_an_address_that_is_none_is_refused(http):
    for url in ("ftp://camera/now.jpg", "http://viewer:secret@camera/", "camera"):
        body = {**CAMERA, "snapshot_url": url}
        problem(http.post("/cameras", json=body), 422, "malformed")
