import copy
import math

import cv2
import numpy as np
import pytest
from fastapi.testclient import TestClient

from models.geometry.pose import CameraPose
from service.app import create_app
from service.store import cameras, references
from service.store.engines.store import Store
from tests.conftest import CAMERA
from tests.service.conftest import problem


def test_registration_answers_with_location_and_queues_a_training(http):
    answer = http.post("/cameras", json=CAMERA)
    assert answer.status_code == 201
    assert answer.headers["Location"] == "/cameras/corner"
    trainings = http.get("/cameras/corner/trainings").json()["items"]
    assert [t["state"] for t in trainings] == ["queued"]
    assert trainings[0]["recipe"] == "default"


def test_where_trainings_are_off_only_a_person_begins_one(settings):
    with TestClient(create_app(settings.model_copy(update={"trainings": "off"}))) as http:
        etag = http.post("/cameras", json=CAMERA).headers["ETag"]
        change = {"prior_pose": {"height_m": 6.0, "tilt_deg": 30.0}}
        changed = http.patch("/cameras/corner", json=change, headers={"If-Match": etag})
        assert changed.status_code == 200
        assert http.get("/cameras/corner/trainings").json()["items"] == []
        assert http.post("/cameras/corner/trainings", json={}).status_code == 202
        (asked,) = http.get("/cameras/corner/trainings").json()["items"]
        assert asked["state"] == "queued"


def test_unset_fields_take_their_defaults(http):
    camera = {
        "intrinsics": CAMERA["intrinsics"],
        "prior_pose": {"height_m": 5.0, "tilt_deg": 30.0},
        "name": "Gate 7, North",
    }
    body = http.post("/cameras", json=camera).json()
    assert body["id"] == "gate-7-north"
    pose = body["prior_pose"]
    assert (pose["roll_deg"], pose["heading_deg"], pose["x_m"], pose["y_m"]) == (0, 0, 0, 0)
    assert body["walking_speed"] == {"mean_mps": 1.4, "sd_mps": 0.1}
    assert body["reference_tracks"] == 200
    assert body["intrinsics"]["distortion"] == [0, 0, 0, 0, 0]


@pytest.fixture
def pose():
    return CameraPose(
        height_m=7.5,
        tilt_rad=math.radians(20),
        roll_rad=math.radians(-3),
        heading_rad=math.radians(70),
        x_m=2.0,
        y_m=-4.0,
    )


@pytest.mark.parametrize("form", ["matrix", "rvec", "quaternion"])
def test_every_form_of_a_pose_is_the_same_pose(http, pose, form):
    given = {
        "matrix": {
            "rotation": pose.rotation.tolist(),
            "translation_m": pose.translation_m.tolist(),
        },
        "rvec": {
            "rvec": cv2.Rodrigues(pose.rotation)[0].ravel().tolist(),
            "tvec_m": pose.translation_m.tolist(),
        },
        "quaternion": {
            # -q is the same orientation, and need not have unit length
            "quaternion_wxyz": (-2 * pose.quaternion_wxyz).tolist(),
            "position_m": pose.centre_m.tolist(),
        },
    }[form]
    answer = http.post("/cameras", json={**CAMERA, "prior_pose": given})
    assert answer.status_code == 201, answer.text
    back = answer.json()["prior_pose"]
    assert back["height_m"] == pytest.approx(7.5)
    assert back["tilt_deg"] == pytest.approx(20)
    assert back["roll_deg"] == pytest.approx(-3)
    assert back["heading_deg"] == pytest.approx(70)
    assert (back["x_m"], back["y_m"]) == pytest.approx((2.0, -4.0))
    np.testing.assert_allclose(back["rotation"], pose.rotation, atol=1e-12)


@pytest.mark.parametrize(
    ("path", "value", "pointer"),
    [
        (("id",), "Not A Slug", "/id"),
        (("intrinsics", "fx"), -1, "/intrinsics/fx"),
        (("intrinsics", "width"), 0, "/intrinsics/width"),
        (("intrinsics", "distortion"), [0.1], "/intrinsics/distortion"),
        (("prior_pose",), {"heading_deg": 3.0}, "/prior_pose"),
        (("prior_pose",), {"height_m": -3.0, "tilt_deg": 10}, "/prior_pose/height_m"),
        (("prior_pose",), {"height_m": 3.0, "tilt_deg": 100}, "/prior_pose/tilt_deg"),
        (("prior_pose",), {"rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}, "/prior_pose"),
        (("frame_rate_hz",), 0, "/frame_rate_hz"),
    ],
)
def test_a_bad_field_is_named(http, path, value, pointer):
    body = copy.deepcopy(CAMERA)
    at = body
    for part in path[:-1]:
        at = at[part]
    at[path[-1]] = value
    document = problem(http.post("/cameras", json=body), 422, "malformed")
    assert pointer in [error["pointer"] for error in document["errors"]]
    assert http.get("/cameras").json()["items"] == []


def test_a_reflection_is_no_rotation(http):
    mirrored = [[-1, 0, 0], [0, 0, -1], [0, 1, 0]]
    pose = {"rotation": mirrored, "translation_m": [0, 0, 0]}
    document = problem(http.post("/cameras", json={**CAMERA, "prior_pose": pose}), 422, "malformed")
    assert "reflection" in document["detail"]


def test_an_id_is_taken_once(http):
    http.post("/cameras", json=CAMERA)
    problem(http.post("/cameras", json=CAMERA), 409, "conflict")


def test_an_unknown_camera_is_a_problem_document(http):
    document = problem(http.get("/cameras/nowhere"), 404, "not_found")
    assert "nowhere" in document["detail"]


def test_cameras_come_in_pages(http):
    for number in range(5):
        http.post("/cameras", json={**CAMERA, "id": f"cam-{number}"})
    seen, cursor = [], ""
    while cursor is not None:
        page = http.get("/cameras", params={"limit": 2, "cursor": cursor}).json()
        seen += [camera["id"] for camera in page["items"]]
        cursor = page["next_cursor"]
    assert seen == [f"cam-{number}" for number in range(5)]


def test_a_change_needs_the_version_that_was_read(http):
    etag = http.post("/cameras", json=CAMERA).headers["ETag"]
    change = {"name": "Renamed"}
    for unsaid in (http.patch("/cameras/corner", json=change), http.delete("/cameras/corner")):
        told = problem(unsaid, 428, "precondition_required")
        assert told["etag"] == unsaid.headers["ETag"] == etag
        assert etag in told["detail"]
    answer = http.patch("/cameras/corner", json=change, headers={"If-Match": etag})
    assert answer.json()["name"] == "Renamed"
    stale = http.patch("/cameras/corner", json={"name": "Other"}, headers={"If-Match": etag})
    assert problem(stale, 412, "precondition_failed")["etag"] == answer.headers["ETag"]
    assert http.get("/cameras/corner").json()["name"] == "Renamed"
    old = http.delete("/cameras/corner", headers={"If-Match": etag})
    told = problem(old, 412, "precondition_failed")
    copied = {"If-Match": told["etag"]}
    assert http.delete("/cameras/corner", headers=copied).status_code == 204
    problem(http.delete("/cameras/corner"), 404, "not_found")


def test_a_new_prior_pose_replaces_the_training_under_way(http):
    etag = http.post("/cameras", json=CAMERA).headers["ETag"]
    change = {"prior_pose": {"height_m": 6.0, "tilt_deg": 30.0}}
    http.patch("/cameras/corner", json=change, headers={"If-Match": etag})
    states = [t["state"] for t in http.get("/cameras/corner/trainings").json()["items"]]
    assert states == ["queued", "cancelled"]
    assert http.get("/cameras/corner/pose").json()["pose"]["tilt_deg"] == pytest.approx(30)


def test_a_removed_camera_is_gone_with_its_tracks(http: TestClient):
    etag = http.post("/cameras", json=CAMERA).headers["ETag"]
    assert http.delete("/cameras/corner", headers={"If-Match": etag}).status_code == 204
    problem(http.get("/cameras/corner"), 404, "not_found")
    problem(http.get("/cameras/corner/trainings"), 404, "not_found")


def test_a_camera_that_is_registered_anew_is_another_version(http):
    first = http.post("/cameras", json=CAMERA).headers["ETag"]
    http.delete("/cameras/corner", headers={"If-Match": first}).raise_for_status()
    assert http.post("/cameras", json=CAMERA).headers["ETag"] != first
    stale = http.patch("/cameras/corner", json={"name": "Old"}, headers={"If-Match": first})
    problem(stale, 412, "precondition_failed")


def test_ids_of_poses_and_references_are_given_once(http, settings):
    """A look that is under way on a deleted camera must not be saved as that of the next one."""

    def ids():
        with Store(settings).read() as session:
            prior, reference = (
                cameras.prior_pose(session, "corner"),
                references.newest(session, "corner"),
            )
            return prior.id, reference.id

    http.post("/cameras", json=CAMERA).raise_for_status()
    first = ids()
    http.delete("/cameras/corner", headers={"If-Match": "*"}).raise_for_status()
    http.post("/cameras", json=CAMERA).raise_for_status()
    assert all(later > before for later, before in zip(ids(), first, strict=True))
