"""`pose.yaml`, read back by OpenCV itself."""

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from models.geometry.ground import ground_from_pixel, pixel_from_ground
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from service.formats.opencv_yaml import opencv_yaml
from tests.conftest import CAMERA
from tests.service.bench import moved
from tests.service.conftest import problem

TOWN = Intrinsics(
    width=1920, height=1080, fx=2696.36, fy=2700.5, cx=959.5, cy=539.5,
    distortion=(-0.6, 4.7, -0.0005, -0.0078, 0.0),
)  # fmt: skip
NAMES = ("K", "distortion", "R", "t", "P", "H_image_from_ground", "H_ground_from_image")


def read(text):
    storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    assert storage.isOpened()
    size = (int(storage.getNode("image_width").real()), int(storage.getNode("image_height").real()))
    return {name: storage.getNode(name).mat() for name in NAMES}, size, storage


def test_opencv_projects_with_it_as_we_do():
    pose = CameraPose(
        height_m=7.844, tilt_rad=0.35, roll_rad=0.025, heading_rad=1.08, x_m=-9.04, y_m=-5.0
    )
    text = opencv_yaml(TOWN, pose, camera_id="town-centre", words=["state: ok", "why: a\nb: c"])
    found, size, storage = read(text)
    assert size == (1920, 1080)
    assert storage.getNode("camera_id").string() == "town-centre"
    ahead = np.array([np.sin(1.08), np.cos(1.08)])
    ground = pose.centre_m[:2] + np.outer([15.0, 20.0, 30.0], ahead) + [[1, 0], [0, 0], [0, 2]]
    points = np.column_stack([ground, np.zeros(3)])
    rvec, _ = cv2.Rodrigues(found["R"])
    seen, _ = cv2.projectPoints(points, rvec, found["t"], found["K"], found["distortion"])
    ours, _ = pixel_from_ground(TOWN, pose.rotation, pose.centre_m, ground)
    assert_allclose(seen[:, 0], ours, atol=1e-6)


def test_homographies_go_both_ways_between_ground_and_undistorted_pixels():
    pose = CameraPose(height_m=6.0, tilt_rad=0.5, roll_rad=-0.1, heading_rad=2.0, x_m=4.0, y_m=1.0)
    found, _, _ = read(opencv_yaml(TOWN, pose, camera_id="c", words=[]))
    straight = Intrinsics(width=1920, height=1080, fx=2696.36, fy=2700.5, cx=959.5, cy=539.5)
    uv = np.array([[100.0, 900.0], [960.0, 700.0], [1800.0, 1000.0]])
    ground, valid = ground_from_pixel(straight, pose.rotation, pose.centre_m, uv)
    assert valid.all()
    there = cv2.perspectiveTransform(uv[None], found["H_ground_from_image"])[0]
    assert_allclose(there, ground, atol=1e-7)
    back = cv2.perspectiveTransform(ground[None], found["H_image_from_ground"])[0]
    assert_allclose(back, uv, atol=1e-6)
    world = np.array([*ground[0], 0.0, 1.0])
    image = found["P"] @ world
    assert_allclose(image[:2] / image[2], uv[0], atol=1e-6)


def test_the_served_pose_as_a_file(bench):
    for _ in range(3):
        bench.see(moved(tilt_deg=5.0))
    answer = bench.http.get("/cameras/corner/pose.yaml")
    assert answer.status_code == 200
    assert answer.headers["content-type"].startswith("application/yaml")
    found, size, _ = read(answer.text)
    assert size == (CAMERA["intrinsics"]["width"], CAMERA["intrinsics"]["height"])
    pose = bench.pose()["pose"]
    assert_allclose(found["R"], pose["rotation"], atol=1e-12)
    assert_allclose(found["t"].ravel(), pose["translation_m"], atol=1e-12)
    height = (-found["R"].T @ found["t"]).ravel()[2]
    assert height == pytest.approx(6.0)
    assert "# state: drifting" in answer.text
    problem(bench.http.get("/cameras/nowhere/pose.yaml"), 404, "not_found")
