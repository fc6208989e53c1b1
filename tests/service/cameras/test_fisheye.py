"""A fisheye camera from its registration to files of its pose."""

import io
import json
import math
import zipfile

import cv2
import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose

from models.geometry.ground import pixel_from_ground
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from service.formats.calibration_file import read_calibration
from service.formats.pose_formats import PoseFormat, pose_file
from tests.service.cameras.test_registration import ANGLES, preview
from tests.service.conftest import problem

NUMBERS = {"fx": 500.0, "fy": 505.0, "cx": 950.0, "cy": 545.0}
K = [0.05, -0.02, 0.004, -0.001]
LENS = {"width": 1920, "height": 1080, "fisheye": {**NUMBERS, "distortion": K}}
POSE = {"height_m": 5.0, "tilt_deg": 40.0, "roll_deg": 2.0}
VALUE = Intrinsics(width=1920, height=1080, **NUMBERS, projection="fisheye", distortion=tuple(K))
STANDS = CameraPose.of_degrees(**POSE)
GROUND = np.array([[1.0, 6.0], [-8.0, 9.0], [4.0, 3.0]])


def track(name, uv):
    points = [[1_700_000_000.0 + n, *np.add(uv, [3.0 * n, n])] for n in range(6)]
    return {"id": name, "points": points}


def draw(http, zone):
    etag = http.get("/cameras/dome/zones").headers["etag"]
    return http.put("/cameras/dome/zones", json={"zones": [zone]}, headers={"If-Match": etag})


@pytest.fixture
def camera(http):
    answer = http.post("/cameras", json={"id": "dome", "lens": LENS, "prior_pose": POSE})
    assert answer.status_code == 201, answer.text
    return answer.json()


def test_a_camera_is_registered_read_and_registered_again(http, camera):
    lens = camera["intrinsics"]
    assert (lens["projection"], lens["distortion"], lens["fy"]) == ("fisheye", K, 505.0)
    assert camera["questions"] == []
    again = {"id": "again", "intrinsics": lens, "prior_pose": POSE}
    assert http.post("/cameras", json=again).json()["intrinsics"] == lens
    etag = http.get("/cameras/dome").headers["etag"]
    narrower = {"lens": {"width": 1920, "height": 1080, "hfov_deg": 90.0}}
    changed = http.patch("/cameras/dome", json=narrower, headers={"If-Match": etag}).json()
    assert changed["intrinsics"]["projection"] == "perspective"
    assert changed["intrinsics"]["distortion"] == [0.0] * 5


@pytest.mark.parametrize(
    ("lens", "pointer"),
    [
        ({"fisheye": {**NUMBERS, "distortion": [0.1] * 5}}, "/lens/fisheye/distortion"),
        ({"fisheye": {"fy": 500.0}}, "/lens/fisheye/fx"),
        ({"fisheye": NUMBERS, "hfov_deg": 90.0}, "/lens"),
    ],
)
def test_what_makes_no_fisheye_is_refused(http, lens, pointer):
    body = {"lens": {"width": 1920, "height": 1080, **lens}, "prior_pose": POSE}
    told = problem(http.post("/cameras", json=body), 422, "malformed")
    assert told["errors"][0]["pointer"] == pointer


def test_numbers_of_the_other_projection_are_refused(http):
    size = {"width": 1920, "height": 1080, **NUMBERS}
    for projection, count in (("fisheye", 5), ("perspective", 4), ("other", 4)):
        lens = {**size, "projection": projection, "distortion": [0.0] * count}
        answer = http.post("/cameras", json={"intrinsics": lens, "prior_pose": POSE})
        problem(answer, 422, "malformed")


def test_pixels_that_the_lens_does_not_see_are_refused_by_name(http, camera):
    # 1.62 rad, 92.8 deg from the axis: within the picture, and beyond the lens.
    beyond = [115.0, 545.0]
    assert VALUE.beyond(np.array(beyond))
    body = {"source": "s", "tracks": [track("in", [900.0, 700.0]), track("out", beyond)]}
    receipt = http.post("/cameras/dome/tracks", json=body).json()
    assert receipt["accepted"] == 1
    (rejected,) = receipt["rejected"]
    assert (rejected["id"], rejected["code"]) == ("out", "outside_lens")
    assert "within 88 deg of its axis" in rejected["detail"]
    assert "(115.0, 545.0)" in rejected["detail"]
    zone = {"id": "z", "on": "ground", "points": [[900, 700], [1000, 700], beyond]}
    answer = draw(http, zone)
    assert "within 88 deg" in problem(answer, 422, "malformed")["detail"]
    places = http.post("/cameras/dome/ground", json={"points": [beyond, [900, 700]]}).json()
    assert places["points"][0] is None
    assert places["points"][1] is not None


def test_the_ground_and_its_picture_are_inverse(http, camera):
    uv, _ = pixel_from_ground(VALUE, STANDS.rotation, STANDS.centre_m, GROUND)
    answer = http.post("/cameras/dome/ground", json={"points": uv.tolist()}).json()
    found = [[each["x_m"], each["y_m"]] for each in answer["points"]]
    assert_allclose(found, GROUND, atol=1e-6)
    zone = {"id": "z", "on": "ground", "points": uv.tolist()}
    assert draw(http, zone).status_code == 200
    (seen,) = http.get("/cameras/dome/zones").json()["zones"]
    assert_allclose(seen["points_now"], uv, atol=0.01)
    assert http.get("/ui/cameras/dome").status_code == 200


def same_pixels(matrix, distortion):
    rvec, _ = cv2.Rodrigues(STANDS.rotation)
    points = np.column_stack([GROUND, np.zeros(3)])[:, None]
    seen, _ = cv2.fisheye.projectPoints(
        points, rvec, STANDS.translation_m, np.array(matrix), np.array(distortion)
    )
    ours, _ = pixel_from_ground(VALUE, STANDS.rotation, STANDS.centre_m, GROUND)
    assert_allclose(seen[:, 0], ours, atol=1e-6)


def written(kind):
    return pose_file(kind, VALUE, STANDS, camera_id="dome", at=None, words=[]).content


@pytest.mark.parametrize("kind", [PoseFormat.OPENCV, PoseFormat.ROS])
def test_files_carry_the_lens_and_are_read_again(http, kind):
    text = written(kind)
    found = read_calibration(text.encode())
    assert found.projection == "fisheye"
    same_pixels(np.reshape(found.matrix, (3, 3)), found.distortion)
    if kind is PoseFormat.ROS:
        assert next(iter(yaml.safe_load_all(text)))["distortion_model"] == "equidistant"
    headers = {"Content-Type": "application/octet-stream"}
    fields = http.post("/ui/calibration", content=text.encode(), headers=headers).json()["fields"]
    assert fields["projection"] == "fisheye"
    typed = {**ANGLES, **fields, "id": "by-file", "width": "1920", "height": "1080"}
    assert preview(http, **typed)["errors"] == {}
    lens = http.post("/ui/register", json=typed).json()["intrinsics"]
    assert lens == {**NUMBERS, "width": 1920, "height": 1080, "projection": "fisheye",
                    "distortion": K}  # fmt: skip


def test_a_model_of_another_lens_is_refused_by_name(http):
    text = written(PoseFormat.ROS).replace("equidistant", "scaramuzza")
    answer = http.post("/ui/calibration", content=text.encode())
    assert "scaramuzza" in problem(answer, 422, "malformed")["detail"]


def test_colmap_and_geojson_know_it():
    with zipfile.ZipFile(io.BytesIO(written(PoseFormat.COLMAP))) as archive:
        _, model, _, _, fx, fy, cx, cy, *k = archive.read("cameras.txt").decode().split()
    assert model == "OPENCV_FISHEYE"
    matrix = [[float(fx), 0, float(cx) - 0.5], [0, float(fy), float(cy) - 0.5], [0, 0, 1]]
    same_pixels(matrix, [float(each) for each in k])
    _, outline = json.loads(written(PoseFormat.GEOJSON))["features"]
    (ring,) = outline["geometry"]["coordinates"]
    reach = np.linalg.norm(np.array(ring), axis=1)
    assert np.isfinite(reach).all()
    assert math.isclose(reach.max(), outline["properties"]["reach_m"], rel_tol=1e-6)
