"""A pose in other tools' formats, read back by other readers, on recorded scenes."""

import io
import json
import math
import zipfile
from datetime import UTC, datetime

import cv2
import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose

from models.geometry.ground import pixel_from_ground
from models.tracks.scenes import load_scene
from service.formats.geojson import GeoOrigin, geojson
from service.formats.opencv_yaml import yaml_number
from service.formats.pose_formats import PoseFormat, pose_file
from tests.conftest import SCENES
from tests.service.bench import moved
from tests.service.conftest import problem

AT = datetime(2026, 11, 25, 8, 30, 0, 250_000, tzinfo=UTC)
FOLDERS = sorted(path.parent for path in SCENES.glob("*/camera.json"))
recorded = pytest.mark.parametrize("folder", FOLDERS, ids=lambda path: path.name)
ANGLE_DEG = 0.01


def written(folder, kind, **others):
    scene = load_scene(folder)
    file = pose_file(
        kind,
        scene.intrinsics,
        scene.true_pose,
        camera_id=scene.scene_id,
        at=AT,
        words=["state: ok", "why: a\nb: c"],
        **others,
    )
    return scene, file.content


def quaternion_rotation(w, x, y, z):
    """By Rodrigues of OpenCV: not by our own formulas."""
    angle = 2 * math.atan2(math.sqrt(x * x + y * y + z * z), w)
    axis = np.array([x, y, z]) / max(math.sqrt(x * x + y * y + z * z), 1e-300)
    return cv2.Rodrigues(axis * angle)[0]


def same_camera(scene, matrix, distortion, rotation, translation):
    """It stands and looks the same, and sees the same ground at the same pixels."""
    turned = cv2.Rodrigues(rotation @ scene.true_pose.rotation.T)[0]
    assert math.degrees(np.linalg.norm(turned)) < ANGLE_DEG
    assert_allclose(-rotation.T @ translation, scene.true_pose.centre_m, atol=1e-6)
    ahead = scene.true_pose.heading_rad
    away = np.outer([15.0, 20.0, 30.0], [math.sin(ahead), math.cos(ahead)])
    ground = scene.true_pose.centre_m[:2] + away
    points = np.column_stack([ground, np.zeros(3)])
    seen, _ = cv2.projectPoints(points, rotation, translation, matrix, np.array(distortion))
    ours, valid = pixel_from_ground(
        scene.intrinsics, scene.true_pose.rotation, scene.true_pose.centre_m, ground
    )
    assert valid.any()
    assert_allclose(seen[valid, 0], ours[valid], atol=1e-5)


@recorded
def test_ros_reads_the_lens_and_the_pose(folder):
    scene, text = written(folder, PoseFormat.ROS)
    lens, stamped = yaml.safe_load_all(text)
    assert lens["distortion_model"] == "plumb_bob"
    assert (lens["image_width"], lens["image_height"]) == (
        scene.intrinsics.width,
        scene.intrinsics.height,
    )
    assert lens["camera_name"].replace("_", "").isalnum()
    matrix = np.array(lens["camera_matrix"]["data"]).reshape(3, 3)
    assert_allclose(np.array(lens["projection_matrix"]["data"]).reshape(3, 4)[:, :3], matrix)
    assert stamped["header"]["frame_id"] == "map"
    seconds = stamped["header"]["stamp"]["sec"] + 1e-9 * stamped["header"]["stamp"]["nanosec"]
    assert seconds == pytest.approx(AT.timestamp(), abs=1e-6)
    place, turn = stamped["pose"]["position"], stamped["pose"]["orientation"]
    world_from_camera = quaternion_rotation(turn["w"], turn["x"], turn["y"], turn["z"])
    centre = np.array([place["x"], place["y"], place["z"]])
    rotation = world_from_camera.T
    distortion = lens["distortion_coefficients"]["data"]
    same_camera(scene, matrix, distortion, rotation, -rotation @ centre)


@recorded
def test_colmap_reads_the_lens_and_the_pose(folder):
    scene, packed = written(folder, PoseFormat.COLMAP)
    assert packed == written(folder, PoseFormat.COLMAP)[1]  # as its strong ETag promises
    with zipfile.ZipFile(io.BytesIO(packed)) as archive:
        files = {name: archive.read(name).decode() for name in archive.namelist()}
    assert set(files) == {"cameras.txt", "images.txt", "points3D.txt"}
    camera_id, model, width, height, *numbers = files["cameras.txt"].split()
    assert (int(width), int(height)) == (scene.intrinsics.width, scene.intrinsics.height)
    assert model == ("FULL_OPENCV" if scene.intrinsics.distortion[4] else "OPENCV")
    fx, fy, cx, cy, *distortion = map(float, numbers)
    assert len(distortion) == {"OPENCV": 4, "FULL_OPENCV": 8}[model]
    matrix = np.array([[fx, 0, cx - 0.5], [0, fy, cy - 0.5], [0, 0, 1]])
    image, points, _ = files["images.txt"].split("\n")
    _, w, x, y, z, *translation, of_camera, name = image.split()
    assert (of_camera, name, points) == (camera_id, f"{scene.scene_id}.jpg", "")
    rotation = quaternion_rotation(*map(float, (w, x, y, z)))
    same_camera(scene, matrix, distortion, rotation, np.array(translation, dtype=float))


@recorded
def test_nvidia_reads_matrices_that_agree(folder):
    scene, text = written(folder, PoseFormat.NVIDIA)
    (sensor,) = json.loads(text)["sensors"]
    assert (sensor["type"], sensor["id"]) == ("camera", scene.scene_id)
    projection = np.array(sensor["cameraMatrix"])
    k, rotation, centre = cv2.decomposeProjectionMatrix(projection)[:3]
    same_camera(
        scene,
        k / k[2, 2],
        scene.intrinsics.distortion,
        rotation,
        -rotation @ (centre[:3] / centre[3]).ravel(),
    )
    extrinsic = np.array(sensor["extrinsicMatrix"])
    assert_allclose(np.array(sensor["intrinsicMatrix"]) @ extrinsic, projection)
    place = sensor["coordinates"]
    assert_allclose([place["x"], place["y"], place["z"]], scene.true_pose.centre_m)
    on_ground = np.array([[[7.0, 9.0]]])
    seen = cv2.perspectiveTransform(on_ground, np.array(sensor["homography"]))[0, 0]
    image = projection @ [7.0, 9.0, 0.0, 1.0]
    assert_allclose(seen, image[:2] / image[2])


@recorded
def test_the_footprint_ends_where_the_picture_does(folder):
    scene, text = written(folder, PoseFormat.GEOJSON)
    document = json.loads(text)
    assert document["crs"] is None
    point, polygon = document["features"]
    told = point["properties"]
    assert told["tilt_deg"] == pytest.approx(math.degrees(scene.true_pose.tilt_rad), abs=1e-9)
    assert_allclose(point["geometry"]["coordinates"], scene.true_pose.centre_m[:2])
    (ring,) = polygon["geometry"]["coordinates"]
    assert ring[0] == ring[-1]
    corners = np.array(ring, dtype=np.float32)
    assert cv2.contourArea(corners, oriented=True) > 0  # anticlockwise, as RFC 7946 asks
    near = np.linalg.norm(corners - scene.true_pose.centre_m[:2], axis=1)
    near = near < 0.999 * polygon["properties"]["reach_m"]
    points = np.column_stack([np.array(ring)[near], np.zeros(near.sum())])
    lens, pose = scene.intrinsics, scene.true_pose
    seen, _ = cv2.projectPoints(
        points, pose.rotation, pose.translation_m, lens.matrix, np.array(lens.distortion)
    )
    u, v = seen[:, 0].T
    off = np.minimum(
        np.minimum(abs(u + 0.5), abs(u - lens.width + 0.5)),
        np.minimum(abs(v + 0.5), abs(v - lens.height + 0.5)),
    )
    assert off.max() < 0.01


def test_an_origin_puts_the_world_on_the_earth():
    """Pin: at 45 deg N a degree is 111,131.78 m northwards and 78,846.81 m eastwards (WGS 84)."""
    origin = GeoOrigin(lat_deg=45.0, lon_deg=7.0)
    lon, lat = origin.lon_lat(np.array([[788.4681, 1111.3178]]))[0]
    assert (lon, lat) == pytest.approx((7.01, 45.01), abs=1e-7)


def test_a_camera_that_sees_no_ground_has_no_footprint(lens, pose):
    up = type(pose)(height_m=6.0, tilt_rad=math.radians(-60))
    document = json.loads(geojson(lens, up, camera_id="c", origin=None))
    assert [each["geometry"]["type"] for each in document["features"]] == ["Point"]


def test_small_numbers_stay_numbers_in_yaml():
    for value in (1e-05, -3e300, 2.5e-7, 0.0, 12.0):
        assert yaml.safe_load(f"[{yaml_number(value)}]") == [value]


MEDIA = {
    "opencv": "application/yaml",
    "ros": "application/yaml",
    "geojson": "application/geo+json",
    "colmap": "application/zip",
    "nvidia": "application/vnd.surefoot.calibration+json",
}


def test_the_served_pose_in_each_format(bench):
    for _ in range(3):
        bench.see(moved(tilt_deg=5.0))
    ours = bench.http.get("/cameras/corner/pose")
    assert set(MEDIA) == set(PoseFormat)
    for name, media_type in MEDIA.items():
        answer = bench.http.get("/cameras/corner/pose", params={"format": name})
        assert answer.status_code == 200
        assert answer.headers["content-type"].split(";")[0] == media_type
        assert "filename=" in answer.headers["content-disposition"]
        again = bench.http.get(
            "/cameras/corner/pose",
            params={"format": name},
            headers={"If-None-Match": answer.headers["etag"]},
        )
        assert again.status_code == 304
    (sensor,) = answer.json()["sensors"]
    assert_allclose(np.array(sensor["extrinsicMatrix"])[:, :3], ours.json()["pose"]["rotation"])
    same = bench.http.get("/cameras/corner/pose.yaml")
    assert same.text == bench.http.get("/cameras/corner/pose?format=opencv").text


def test_what_is_wrong_with_a_format_or_an_origin_is_named(bench):
    problem(bench.http.get("/cameras/corner/pose?format=kml"), 422, "malformed")
    half = bench.http.get("/cameras/corner/pose?format=geojson&origin_lat_deg=45")
    assert problem(half, 422, "malformed")["errors"][0]["pointer"] == "/origin_lon_deg"
    placed = bench.http.get(
        "/cameras/corner/pose?format=geojson&origin_lat_deg=45&origin_lon_deg=7"
    ).json()
    assert "crs" not in placed
    assert placed["features"][0]["geometry"]["coordinates"] == [7.0, 45.0]
    etag = bench.http.get("/cameras/corner").headers["etag"]
    far = {"prior_pose": {"height_m": 6.0, "tilt_deg": 22.0, "x_m": 5e6}}
    bench.http.patch("/cameras/corner", json=far, headers={"If-Match": etag}).raise_for_status()
    answer = bench.http.get(
        "/cameras/corner/pose?format=geojson&origin_lat_deg=45&origin_lon_deg=7"
    )
    assert "5000000" in problem(answer, 422, "malformed")["detail"].replace(",", "")[:200]
