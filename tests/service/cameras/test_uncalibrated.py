"""A camera of which the lens is known and nothing else: people tell its pose, a person agrees."""

import math

import numpy as np
import pytest

from tests.conftest import CAMERA
from tests.service.conftest import problem
from tests.service.street import KNOCKED, LENS, PRIOR, Street

BARE = {name: value for name, value in CAMERA.items() if name != "prior_pose"}


@pytest.fixture
def street(http, settings):
    http.post("/cameras", json={**BARE, "reference_tracks": 60}).raise_for_status()
    return Street(http, settings)


def test_people_tell_its_pose_a_person_agrees_and_drift_is_told_against_it(street):
    camera = street.http.get("/cameras/corner").json()
    assert camera["prior_pose"] is None
    assert street.pose()["state"] == "unconnected"
    street.keep_to_lanes(PRIOR, 70)
    before = street.look()
    assert (before["state"], before["reason_code"]) == ("uncalibrated", "pose_proposed")
    proposed, sd = before["proposed"]["pose"], before["proposed"]["sd"]
    assert before["proposed"]["can_be_confirmed"]
    assert abs(proposed["tilt_deg"] - 22.0) < 2 * sd["tilt_deg"] < 5.0
    assert abs(proposed["height_m"] - 6.0) < 2 * sd["height_m"]
    # Until the pose is confirmed, nothing is estimated, learned or alarmed.
    assert (before["estimated"], before["drift"], street.alerts()) == ([], None, [])
    problem(street.http.get("/cameras/corner/pose.yaml"), 409, "conflict")
    told = problem(street.http.post("/cameras/corner/ground", json={"points": []}), 409, "conflict")
    assert told["detail"] == "pose: no prior pose has been confirmed yet"
    gate = {"zones": [{"id": "gate", "points": [[400, 350.5], [800, 361], [900, 600]]}]}
    drawn = street.http.put("/cameras/corner/zones", json=gate, headers={"If-Match": "*"})
    assert drawn.raise_for_status().json()["by"]["pose"] is None

    confirmed = street.http.post("/cameras/corner/pose/confirm", json={"by": "Ada"})
    assert confirmed.status_code == 200
    assert (confirmed.json()["state"], confirmed.json()["proposed"]) == ("learning", None)
    assert street.http.get("/cameras/corner").json()["prior_pose"] == proposed
    entries = street.http.get("/activity", params={"camera_id": "corner"}).json()["items"]
    assert ("pose.confirmed", "Ada") in [(each["what"], each["by"]) for each in entries]
    # Whoever was seen so far makes the reference: it need not be waited for.
    after = street.look()
    assert (after["state"], after["reference"]["state"]) in [("ok", "ready"), ("learning", "ready")]
    problem(street.http.post("/cameras/corner/pose/confirm"), 409, "conflict")

    zones = street.http.get("/cameras/corner/zones").json()
    assert (zones["moved"], zones["by"]["pose"]) == (False, proposed)
    assert zones["zones"][0]["points_now"] == gate["zones"][0]["points"]
    assert all(sd[0] > 0 for sd in zones["zones"][0]["sd_px"])

    street.keep_to_lanes(KNOCKED, 60)
    moved = street.look()
    assert street.http.get("/cameras/corner/zones").json()["moved"]
    assert moved["state"] == "drifting"
    assert moved["drift"]["tilt_deg"] == pytest.approx(5.0, abs=1.5)
    assert [alert["kind"] for alert in street.alerts()] == ["drift"]


def test_too_few_people_are_told_and_cannot_be_agreed_to(street):
    problem(street.http.post("/cameras/corner/pose/confirm"), 409, "conflict")
    street.cross(PRIOR, 2)
    few = street.look()
    assert (few["state"], few["proposed"], few["reason_code"]) == (
        "uncalibrated", None, "pose_unknown"
    )  # fmt: skip
    assert few["reason_values"]["tracks"] == 2
    street.cross(PRIOR, 20)  # all one way
    one_way = street.look()
    assert one_way["reason_code"] == "pose_untold"
    assert not one_way["proposed"]["can_be_confirmed"]
    problem(street.http.post("/cameras/corner/pose/confirm"), 409, "conflict")


def test_measured_height_gives_the_sd_of_a_tape(http, settings):
    body = {**BARE, "prior_pose": {"height_m": 6.0}}
    made = http.post("/cameras", json=body).raise_for_status().json()
    assert (made["prior_pose"], made["measured"]) == (
        None, {"height_m": 6.0, "tilt_deg": None, "roll_deg": None}
    )  # fmt: skip
    street = Street(http, settings)
    street.keep_to_lanes(PRIOR, 70)
    found = street.look()["proposed"]
    assert found["pose"]["height_m"] == pytest.approx(6.0, rel=0.05)
    assert found["sd"]["height_m"] <= 0.05 * found["pose"]["height_m"]
    http.patch(
        "/cameras/corner", json={"name": "Another"}, headers={"If-Match": "*"}
    ).raise_for_status()
    assert street.pose()["state"] == "uncalibrated"
    assert http.get("/cameras/corner").json()["measured"] == made["measured"]


def test_patch_takes_measurements_until_there_is_a_prior_pose(street):
    headers = {"If-Match": "*"}
    assert street.http.get("/cameras/corner").json()["measured"] is None
    street.keep_to_lanes(PRIOR, 70)
    by_people = street.look()["proposed"]
    assert by_people["sd"]["height_m"] > 0.1 * by_people["pose"]["height_m"]
    given = {"height_m": 6.0, "roll_deg": 1.0}
    lens = CAMERA["intrinsics"]
    for body in ({"prior_pose": given}, {"intrinsics": lens, "prior_pose": given}):
        changed = street.http.patch("/cameras/corner", json=body, headers=headers)
        assert changed.raise_for_status().json()["measured"] == {
            "height_m": 6.0, "tilt_deg": None, "roll_deg": pytest.approx(1.0)
        }  # fmt: skip
        assert changed.json()["prior_pose"] is None
        if "intrinsics" in body:  # another lens: the tracks so far are of the former one
            street.keep_to_lanes(PRIOR, 70)
        found = street.look()["proposed"]
        assert found["sd"]["height_m"] <= 0.05 * found["pose"]["height_m"]
        assert found["sd"]["roll_deg"] == pytest.approx(0.71, abs=0.03)
        assert abs(found["pose"]["roll_deg"] - 1.0) < 2 * found["sd"]["roll_deg"]
    street.http.post("/cameras/corner/pose/confirm").raise_for_status()
    confirmed = street.http.get("/cameras/corner").json()
    assert confirmed["measured"] is None
    assert confirmed["prior_pose"]["height_m"] == pytest.approx(found["pose"]["height_m"])
    again = street.http.patch("/cameras/corner", json={"prior_pose": given}, headers=headers)
    assert problem(again, 409, "conflict")["detail"] == (
        "prior_pose: the camera has one; height_m and tilt_deg are both required to replace it "
        "(got 2 of height_m, tilt_deg, roll_deg)"
    )


def test_measured_height_keeps_its_sd_with_too_few_people(http, settings):
    http.post("/cameras", json={**BARE, "prior_pose": {"height_m": 6.0}}).raise_for_status()
    street = Street(http, settings)
    street.cross(PRIOR, 20)  # all one way
    found = street.look()["proposed"]
    assert not found["can_be_confirmed"]
    assert found["sd"]["height_m"] <= 0.055 * found["pose"]["height_m"]
    assert found["pose"]["height_m"] == pytest.approx(6.0, rel=0.05)


@pytest.mark.parametrize(
    ("pose", "pointer"),
    [({"height_m": 0.0}, "/prior_pose"), ({"heading_deg": 3.0}, "/prior_pose")],
)
def test_what_is_no_measure_is_named(http, pose, pointer):
    found = problem(http.post("/cameras", json={**BARE, "prior_pose": pose}), 422, "malformed")
    assert found["errors"][0]["pointer"].startswith(pointer)


def test_a_prior_pose_that_is_said_later_ends_it(street):
    street.keep_to_lanes(PRIOR, 30)
    street.look()
    whole = CAMERA["prior_pose"]
    headers = {"If-Match": "*"}
    changed = street.http.patch("/cameras/corner", json={"prior_pose": whole}, headers=headers)
    assert changed.json()["prior_pose"]["tilt_deg"] == pytest.approx(22.0)
    assert street.pose()["state"] == "learning"


def test_a_lens_that_changes_leaves_it_uncalibrated(street):
    lens = {**CAMERA["intrinsics"], "fx": 1000.0, "fy": 1000.0}
    changed = street.http.patch(
        "/cameras/corner", json={"intrinsics": lens}, headers={"If-Match": "*"}
    )
    assert changed.json()["prior_pose"] is None
    street.keep_to_lanes(PRIOR, 30)
    assert street.look()["state"] == "uncalibrated"
    assert math.isfinite(street.pose()["pose"]["height_m"])


def marks():
    """A vertical of 2.5 m and a length of 5 m of the street, as its true pose shows them."""
    sine, cosine = math.sin(PRIOR.heading_rad), math.cos(PRIOR.heading_rad)

    def at(forward_m, right_m, up_m=0.0):
        return (forward_m * sine + right_m * cosine, forward_m * cosine - right_m * sine, up_m)

    def seen(*places):
        points, _ = LENS.project((np.array(places) - PRIOR.centre_m) @ PRIOR.rotation.T)
        return points.tolist()

    return [
        {"kind": "vertical", "points": seen(at(12, -3), at(12, -3, 2.5)), "length_m": 2.5},
        {"kind": "length", "points": seen(at(11, -2), at(11, 3)), "length_m": 5.0},
    ]


def test_a_person_helps_with_marks_and_takes_them_back(street):
    path = "/cameras/corner/hints"
    alone = street.http.put(path, json=marks()).json()
    assert alone["proposed"]["tracks"] == 0
    street.keep_to_lanes(PRIOR, 60)
    by_people = street.look()["proposed"]
    with_people = street.http.get(path).json()
    assert by_people == with_people["proposed"]
    assert max(mark["residual_sd"] for mark in with_people["items"]) < 1.5
    assert by_people["pose"]["height_m"] == pytest.approx(6.0, rel=0.05)
    back = street.http.put(path, json=[]).json()
    assert back["items"] == []
    assert back["proposed"]["sd"]["height_m"] > 2 * by_people["sd"]["height_m"]
    confirmed = street.http.post("/cameras/corner/pose/confirm")
    assert confirmed.status_code == 200
    problem(street.http.put(path, json=marks()), 409, "conflict")


@pytest.mark.parametrize(
    "mark",
    [
        {"kind": "length", "points": [[1, 1], [2, 2]]},
        {"kind": "horizon", "points": [[1, 1]]},
        {"kind": "vertical", "points": [[1, 1], [1, 1]]},
        {"kind": "map_point", "points": [[1, 1]], "x_m": 3.0},
        {"kind": "door", "points": [[1, 1], [2, 2]]},
        {"kind": "vertical", "points": [[640, -9e5], [640, -9.1e5]], "length_m": 2.0},
    ],
)
def test_what_is_no_mark_is_refused(street, mark):
    problem(street.http.put("/cameras/corner/hints", json=[mark]), 422, "malformed")
    assert street.http.get("/cameras/corner/hints").json()["items"] == []


def test_marks_stay_where_the_walking_speed_is_changed_and_go_with_the_pictures_size(street):
    path = "/cameras/corner/hints"
    street.http.put(path, json=marks()).raise_for_status()

    def change(**what):
        street.http.patch(
            "/cameras/corner", json=what, headers={"If-Match": "*"}
        ).raise_for_status()
        return len(street.http.get(path).json()["items"])

    assert change(walking_speed={"mean_mps": 1.3, "sd_mps": 0.1}) == 2
    lens = CAMERA["intrinsics"]
    assert change(intrinsics={**lens, "fx": 1000.0, "fy": 1000.0}) == 2
    half = {name: value / 2 for name, value in lens.items()}
    assert change(intrinsics=half | {"width": 640, "height": 360}) == 0


def test_a_pose_stays_as_sure_as_it_was_agreed_to(street):
    street.keep_to_lanes(PRIOR, 60)
    street.look()
    street.http.post("/cameras/corner/pose/confirm").raise_for_status()

    def sure():
        points = {"points": [[600, 600]]}
        return street.http.post("/cameras/corner/ground", json=points).json()["points"][0]["sd_m"]

    before = sure()
    speed = {"walking_speed": {"mean_mps": 1.3, "sd_mps": 0.1}}
    street.http.patch("/cameras/corner", json=speed, headers={"If-Match": "*"}).raise_for_status()
    assert before is not None
    assert sure() == before
