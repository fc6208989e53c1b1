"""Long recordings are read, and cameras put before them see what is there, exactly."""

import csv
import gzip
import json
import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from models.errors import ShapeError
from models.geometry.ground import ground_from_pixel
from models.geometry.pose import CameraPose
from models.simulation.poses import PoseOffset, offset_trajectory
from studies.recordings import load_recording

LENS = {
    "width": 1920, "height": 1080, "fx": 1000.0, "fy": 1000.0, "cx": 959.5, "cy": 539.5,
    "distortion": [0.0] * 5,
}  # fmt: skip
POSE = {
    "x_m": 0.0, "y_m": 0.0, "height_m": 5.0, "tilt_deg": 20.0, "roll_deg": 1.0, "heading_deg": 0.0,
}  # fmt: skip


def write_ground(folder, rows, name="tracks_ground.csv.gz"):
    folder.mkdir(exist_ok=True)
    camera = {
        "id": "hall-a", "frame_rate_hz": 5.0, "intrinsics": LENS, "true_pose": POSE,
        "max_ground_distance_m": 30.0,
    }  # fmt: skip
    (folder / "camera.json").write_text(json.dumps(camera))
    with gzip.open(folder / name, "wt", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["track_id", "time_s", "x_m", "y_m"])
        writer.writerows(rows)
    return folder


@pytest.fixture
def hall(tmp_path):
    """50 people who walk 24 m from left to right, 14 to 20 m ahead, a metre a second."""
    rows = [[n, 60 * n + t, -12 + t, 14 + 0.12 * n] for n in range(50) for t in range(25)]
    return write_ground(tmp_path / "hall", rows)


def test_cameras_before_people_on_the_ground_see_them_where_they_are(hall):
    cameras = load_recording(hall)
    assert [camera.scene_id for camera in cameras] == ["hall-a", "hall-b", "hall-c"]
    assert cameras[0].true_pose.tilt_rad == pytest.approx(math.radians(20))
    for camera in cameras:
        pose = camera.true_pose
        inside = 0
        for track in camera.tracks:
            ground, valid = ground_from_pixel(
                camera.intrinsics, pose.rotation, pose.centre_m, track.trajectory.uv
            )
            n = int(track.track_id)
            assert valid.all()
            assert_allclose(ground[:, 0], track.trajectory.time_s - 60 * n - 12, atol=1e-6)
            assert_allclose(ground[:, 1], 14 + 0.12 * n, atol=1e-6)
            inside += int(camera.intrinsics.contains(track.trajectory.uv).any())
        assert inside >= 5
    headings = [camera.true_pose.heading_rad for camera in cameras]
    assert abs(math.remainder(headings[1] - headings[2], 2 * math.pi)) > math.radians(30)
    again = load_recording(hall)
    assert [camera.true_pose for camera in again] == [camera.true_pose for camera in cameras]


def test_a_pan_brings_people_into_the_picture_who_were_beside_it(hall):
    camera = load_recording(hall)[0]
    track = camera.tracks[0].trajectory
    still = offset_trajectory(track, camera.intrinsics, camera.true_pose, camera.true_pose)
    panned = PoseOffset(heading_rad=math.radians(8)).apply(camera.true_pose)
    turned = offset_trajectory(track, camera.intrinsics, camera.true_pose, panned)
    assert still is not None
    assert turned is not None
    # 14 m ahead the picture ends about 13 m to the right; turned by 8 deg, at 17 and more: nobody
    # is lost there, and the first metres on the left are.
    assert turned.time_s[-1] == track.time_s[-1] == 24
    assert turned.time_s[0] > still.time_s[0]


def test_aligned_days_are_taken_before_the_raw_ones(hall):
    rows = [[7, t, -12 + t, 15] for t in range(25)]
    write_ground(hall, rows * 1, "tracks_ground_aligned.csv.gz")
    assert {track.track_id for track in load_recording(hall)[0].tracks} == {"7"}


def test_real_cameras_count_by_the_pose_with_most_points(tmp_path):
    poses = {"G1": {m: {"intrinsics": LENS, "true_pose": POSE} for m in ("first", "second")}}
    poses["G1"]["second"] = {"intrinsics": LENS, "true_pose": {**POSE, "tilt_deg": 21.0}}
    (tmp_path / "poses.json").write_text(json.dumps(poses))
    with gzip.open(tmp_path / "G1.csv.gz", "wt", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["track_id", "clip", "camera_model", "time_s", "u_px", "v_px", "box_h_px"])
        for t in range(6):
            writer.writerow(["1", "c", "first", t, 500 + t, 600, 100])
        for t in range(9):
            writer.writerow(["2", "c", "second", 100 + t, 500 + t, 600, 100])
            writer.writerow(["3", "c", "second", 200 + t, 500 + t, 90, 100])
    (camera,) = load_recording(tmp_path)
    assert camera.true_pose.tilt_rad == pytest.approx(math.radians(21))
    assert [track.track_id for track in camera.tracks] == ["2", "3"]
    assert_allclose(camera.tracks[0].trajectory.top_v, 500)
    assert np.isnan(camera.tracks[1].trajectory.top_v).all()  # cut by the upper border


def test_what_is_no_recording_is_named(tmp_path, hall):
    with pytest.raises(ShapeError, match="recording"):
        load_recording(tmp_path)
    with gzip.open(hall / "tracks_ground.csv.gz", "wt") as file:
        file.write("track_id,time_s,x,y\n1,2,3,4\n")
    with pytest.raises(ShapeError, match="x_m,y_m are needed, got"):
        load_recording(hall)


def test_a_pose_is_a_value(hall):
    camera = load_recording(hall)[0]
    assert camera.true_pose == replace(
        CameraPose(height_m=5.0, tilt_rad=math.radians(20), roll_rad=math.radians(1)), x_m=0.0
    )
