"""Calibration files through each door, our own exports among them, and homographies."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

import surefoot
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from service.formats.pose_formats import PoseFormat, pose_file
from tests.conftest import CAMERA
from tests.service.cameras.test_registration import preview
from tests.service.conftest import problem
from tests.surefoot.calibration.samples import REJECTED, SAMPLES

LENS = Intrinsics(
    width=1920, height=1080, fx=2696.36, fy=2700.5, cx=959.5, cy=539.5,
    distortion=(-0.6, 4.7, -0.0005, -0.0078, 0.0),
)  # fmt: skip
POSE = CameraPose.of_degrees(
    height_m=7.844, tilt_deg=20.04, roll_deg=1.44, heading_deg=61.92, x_m=-9.04, y_m=-5.0
)
EXPORTS = [PoseFormat.OPENCV, PoseFormat.ROS, PoseFormat.COLMAP, PoseFormat.NVIDIA]


def exported(kind):
    content = pose_file(
        kind, LENS, POSE, camera_id="town-centre", at=None, words=["state: ok"]
    ).content
    return content if isinstance(content, bytes) else content.encode()


def same_pose(given, tolerance=1e-6):
    assert given["height_m"] == pytest.approx(7.844, abs=tolerance)
    assert given["tilt_deg"] == pytest.approx(20.04, abs=tolerance)
    assert given["roll_deg"] == pytest.approx(1.44, abs=tolerance)
    assert given["heading_deg"] == pytest.approx(61.92, abs=tolerance)
    assert (given["x_m"], given["y_m"]) == pytest.approx((-9.04, -5.0), abs=tolerance)


@pytest.mark.parametrize("kind", EXPORTS)
def test_our_own_export_comes_back_through_every_door(http, tmp_path, kind):
    body = exported(kind)
    # NVIDIA's file keeps the image size in fields that are not ours, and has no distortion.
    bare = kind is PoseFormat.NVIDIA
    size = {"width": 1920, "height": 1080} if bare else {}
    found = http.post("/calibrations", content=body, params=size).raise_for_status().json()
    expected = CAMERA["intrinsics"] | {
        "width": 1920, "height": 1080, "fx": 2696.36, "fy": 2700.5, "cx": 959.5, "cy": 539.5,
        "projection": "perspective", "distortion": [0.0] * 5 if bare else list(LENS.distortion),
    }  # fmt: skip
    assert found["intrinsics"] == expected
    same_pose(found["prior_pose"])

    sent = {"rotation": found["prior_pose"]["rotation"],
            "translation_m": found["prior_pose"]["translation_m"]}  # fmt: skip
    made = http.post("/cameras", json={"intrinsics": found["intrinsics"], "prior_pose": sent})
    same_pose(made.raise_for_status().json()["prior_pose"])

    fields = http.post("/ui/calibration", content=body).raise_for_status().json()["fields"]
    shown = preview(http, **{"width": "1920", "height": "1080", **fields})
    assert shown["errors"] == {}
    assert any("7.84 m high, looking down 20.0" in said["text"] for said in shown["says"])

    path = tmp_path / "calibration"
    path.write_bytes(body)
    if bare:
        with pytest.raises(surefoot.CalibrationError, match="width, height: are required"):
            surefoot.read_camera(path)
    else:
        camera = surefoot.read_camera(path)
        assert_allclose(camera.prior_pose.in_radians.centre_m, POSE.centre_m, atol=1e-9)
        assert camera.intrinsics.cx == pytest.approx(959.5)


@pytest.mark.parametrize("name", SAMPLES)
def test_sample_is_the_same_through_http_and_page(http, name):
    sample = SAMPLES[name]
    query = {"camera": sample.camera or "", "width": 640, "height": 480}
    found = http.post("/calibrations", content=sample.body, params=query).raise_for_status().json()
    lens = found["intrinsics"]
    assert (lens["fx"], lens["fy"], lens["cx"], lens["cy"]) == pytest.approx(sample.focal)
    assert (lens["width"], lens["height"]) == sample.size or (640, 480)
    assert len(found["notes"]) == len(sample.notes)
    filled = http.post("/ui/calibration", content=sample.body, params=query).json()
    assert float(filled["fields"]["fx"]) == pytest.approx(sample.focal[0])
    assert all(note in filled["text"] for note in found["notes"])
    assert ("rotation" in filled["fields"]) == (name in ("krtd", "tsai"))


@pytest.mark.parametrize("name", ["transposed", "stereo pair", "ros2 echo"])
def test_note_is_in_words(http, name):
    words = {
        "transposed": "The camera matrix is transposed, as MATLAB writes it.",
        "stereo pair": "R and T are between the two cameras of a stereo pair, no pose in the "
        "world, and are not taken. The lens is that of the first camera.",
        "ros2 echo": "R is the rectification of a stereo camera, not its pose, and is not taken.",
    }
    query = {"width": 640, "height": 480}
    found = http.post("/calibrations", content=SAMPLES[name].body, params=query).json()
    assert (found["prior_pose"], found["notes"]) == (None, [words[name]])


@pytest.mark.parametrize("name", REJECTED)
def test_damaged_file_is_rejected_alike_through_http_and_page(http, name):
    body, _ = REJECTED[name]
    answers = [http.post(path, content=body) for path in ("/calibrations", "/ui/calibration")]
    first, second = (problem(answer, 422, "malformed") for answer in answers)
    assert first["errors"] == second["errors"]
    assert first["errors"][0]["pointer"] == "/file"


def test_impossible_lens_and_missing_size_are_named(http):
    body = SAMPLES["python json"].body
    missing = problem(http.post("/calibrations", content=body), 422, "malformed")
    assert missing["errors"][0]["pointer"] == "/width, height"
    query = {"width": 320, "height": 240}
    found = problem(http.post("/calibrations", content=body, params=query), 422, "malformed")
    assert found["detail"] == "cx: must be within the image, -0.5 to 319.5 px (got 342.45)"


def test_one_camera_of_nvidias_many_is_taken_by_its_id(http):
    (sensor,) = json.loads(exported(PoseFormat.NVIDIA))["sensors"]
    attributes = [{"name": "frameWidth", "value": 1920}, {"name": "frameHeight", "value": "1080"}]
    sensor |= {"attributes": attributes}
    file = {"calibrationType": "cartesian", "sensors": [sensor, {**sensor, "id": "other"}]}
    body = json.dumps(file).encode()
    several = problem(http.post("/calibrations", content=body), 422, "malformed")
    assert several["detail"] == (
        "file: NVIDIA calibration.json: camera: must be one of the 2 in the file: town-centre, "
        "other (got none)"
    )
    found = http.post("/calibrations", content=body, params={"camera": "town-centre"}).json()
    same_pose(found["prior_pose"])
    assert found["intrinsics"]["width"] == 1920
    # The homography alone is enough.
    del sensor["extrinsicMatrix"], sensor["cameraMatrix"]
    alone = json.dumps({"sensors": [sensor]}).encode()
    same_pose(http.post("/calibrations", content=alone).raise_for_status().json()["prior_pose"])
    geo = json.dumps({"calibrationType": "geo", "sensors": [sensor]}).encode()
    told = problem(http.post("/calibrations", content=geo), 422, "malformed")
    assert "calibrationType: must be cartesian (got 'geo')" in told["detail"]
    wrong = {
        **sensor,
        "extrinsicMatrix": np.eye(4)[:3].tolist(),
        "cameraMatrix": [[1, 2, 3, 4]] * 3,
    }
    told = http.post("/calibrations", content=json.dumps({"sensors": [wrong]}).encode())
    assert (
        "cameraMatrix: must be intrinsicMatrix times" in problem(told, 422, "malformed")["detail"]
    )


def homographies():
    bare = Intrinsics(width=1280, height=720, fx=1100, fy=1100, cx=639.5, cy=359.5)
    pose = CameraPose.of_degrees(height_m=6.0, tilt_deg=22.0, roll_deg=1.0, heading_deg=40.0)
    image_from_ground = bare.matrix @ np.column_stack([pose.rotation[:, :2], pose.translation_m])
    return {
        "homography_image_from_ground": (-3.0 * image_from_ground).tolist(),
        "homography_ground_from_image": np.linalg.inv(image_from_ground).tolist(),
    }


@pytest.mark.parametrize("key", homographies())
def test_homography_beside_a_lens_is_a_prior_pose(http, key):
    given = {key: homographies()[key]}
    lens = {"width": 1280, "height": 720, "fx": 1100, "fy": 1100, "cx": 639.5, "cy": 359.5}
    body = {"id": "corner", "intrinsics": lens, "prior_pose": given}
    made = http.post("/cameras", json=body).raise_for_status().json()
    other = {"prior_pose": {"height_m": 3.0, "tilt_deg": 5.0}}
    headers = {"If-Match": "*"}
    http.patch("/cameras/corner", json=other, headers=headers).raise_for_status()
    changed = http.patch("/cameras/corner", json={"prior_pose": given}, headers=headers)
    for pose in (made["prior_pose"], changed.raise_for_status().json()["prior_pose"]):
        assert [pose[name] for name in ("height_m", "tilt_deg", "roll_deg", "heading_deg")] == (
            pytest.approx([6.0, 22.0, 1.0, 40.0])
        )
        assert (pose["x_m"], pose["y_m"]) == pytest.approx((0, 0), abs=1e-9)


def test_homography_that_contradicts_the_lens_is_rejected(http):
    lens = {"width": 1280, "height": 720, "fx": 1100, "fy": 1100, "cx": 639.5, "cy": 359.5}
    matrix = np.array(homographies()["homography_image_from_ground"]) @ np.diag([1.0, 3.0, 1.0])
    given = {"homography_image_from_ground": matrix.tolist()}
    answer = http.post("/cameras", json={"intrinsics": lens, "prior_pose": given})
    (error,) = problem(answer, 422, "malformed")["errors"]
    assert error["pointer"] == "/prior_pose"
    assert (
        "x and y of the ground must be in the same unit, within a factor of 1.25 (got 3)"
        in (error["reason"])
    )
    http.post("/cameras", json=CAMERA).raise_for_status()
    changed = http.patch("/cameras/corner", json={"prior_pose": given}, headers={"If-Match": "*"})
    assert "in the same unit" in problem(changed, 409, "calibration")["detail"]
    both = {**given, "homography_ground_from_image": matrix.tolist()}
    answer = http.post("/cameras", json={"intrinsics": lens, "prior_pose": both})
    assert "must have one form" in problem(answer, 422, "malformed")["detail"]
