import csv
import json
import math
from dataclasses import replace

import numpy as np
import pytest

from models.errors import ShapeError
from models.geometry.ground import pixel_from_ground
from models.simulation.poses import PoseOffset, offset_trajectory, repeated_pose
from models.simulation.walkers import WalkConfig, simulate_walks
from models.tracks.scenes import load_scene
from models.tracks.trajectory import Trajectory
from studies.paper import centred_run
from studies.paper.centred_run import run_averaged
from tests.studies.test_regressors import tiny_plan

pytestmark = pytest.mark.slow


def write_scene(folder, lens, pose, count=40):
    """A scene folder of simulated people."""
    walks = simulate_walks(lens, repeated_pose(pose, count), WalkConfig(), np.random.default_rng(2))
    folder.mkdir(exist_ok=True)
    camera = {
        "id": "made-up",
        "frame_rate_hz": 10.0,
        "intrinsics": {
            "width": lens.width, "height": lens.height, "fx": lens.fx, "fy": lens.fy,
            "cx": lens.cx, "cy": lens.cy, "distortion": list(lens.distortion),
        },
        "true_pose": {
            "x_m": pose.x_m, "y_m": pose.y_m, "height_m": pose.height_m,
            "tilt_deg": math.degrees(pose.tilt_rad), "roll_deg": math.degrees(pose.roll_rad),
            "heading_deg": math.degrees(pose.heading_rad),
        },
    }  # fmt: skip
    (folder / "camera.json").write_text(json.dumps(camera))
    with (folder / "tracks.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["track_id", "frame", "time_s", "u_px", "v_px"])
        for number, (uv, length) in enumerate(zip(walks.uv, walks.lengths, strict=True)):
            for k in reversed(range(length)):  # order of lines does not matter
                time_s = count - number + 0.4 * k
                writer.writerow([number, round(time_s * 10), time_s, *uv[k]])
    return folder


def test_a_scene_is_read_with_its_tracks_in_order_of_time(tmp_path, lens, pose):
    scene = load_scene(write_scene(tmp_path / "s", lens, pose))
    assert (scene.scene_id, scene.frame_rate_hz, scene.intrinsics) == ("made-up", 10.0, lens)
    assert scene.true_pose.tilt_rad == pytest.approx(pose.tilt_rad)
    starts = [track.trajectory.time_s[0] for track in scene.tracks]
    assert starts == sorted(starts)
    assert scene.tracks[0].track_id == "39"


def test_a_folder_that_is_no_scene_is_named(tmp_path):
    with pytest.raises(ShapeError, match=r"camera\.json or tracks\.csv"):
        load_scene(tmp_path)


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("camera.json", '"fy"', '"gy"'),
        ("camera.json", "10.0", "ten"),
        ("tracks.csv", "39,10,1.0,", "39,"),
        ("tracks.csv", "39,10,1.0,", "39,10,noon,"),
    ],
)
def test_a_scene_that_is_broken_is_named(tmp_path, lens, pose, name, old, new):
    folder = write_scene(tmp_path / "s", lens, pose)
    path = folder / name
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(ShapeError, match="scene "):
        load_scene(folder)


@pytest.fixture
def track(tmp_path, lens, pose):
    return load_scene(write_scene(tmp_path / "s", lens, pose)).tracks[3].trajectory


def test_no_knock_changes_nothing(lens, pose, track):
    same_again = offset_trajectory(track, lens, pose, PoseOffset().apply(pose))
    np.testing.assert_allclose(same_again.uv, track.uv, atol=1e-6)


def test_a_knock_and_back_is_where_it_was(lens, pose, track):
    knocked = PoseOffset(tilt_rad=0.02, roll_rad=-0.02, log_height=0.05).apply(pose)
    assert knocked.height_m == pytest.approx(pose.height_m * math.exp(0.05))
    seen = offset_trajectory(track, lens, pose, knocked)
    assert np.abs(seen.uv[0] - track.uv[0]).max() > 5
    back = offset_trajectory(seen, lens, knocked, pose)
    rows = np.isin(track.time_s, back.time_s)
    np.testing.assert_allclose(back.uv, track.uv[rows], atol=1e-6)


def test_only_the_longest_run_inside_the_image_is_seen(lens, pose):
    v = np.array([700.0, 690, 680, 600, 700, 500, 510, 520, 530, 540, 715, 550])
    track = Trajectory(time_s=np.arange(12.0), uv=np.stack([np.full(12, 640.0), v], 1))
    # Looking up by 3.5 deg moves feet down by about 70 px: those below 650 leave the picture.
    seen = offset_trajectory(track, lens, pose, replace(pose, tilt_rad=pose.tilt_rad - 0.061))
    assert seen.time_s.tolist() == [5, 6, 7, 8, 9]
    sky = replace(pose, tilt_rad=-1.0)
    assert offset_trajectory(track, lens, pose, sky) is None


def test_who_walks_behind_a_camera_that_was_turned_is_seen_before(lens, pose):
    # Across the view from 30 m to its right on: turned by 80 deg, the last of them are behind it.
    ahead_m, right_m = 12.0, np.linspace(30.0, -30.0, 21)
    world = pose.centre_m[:2] + np.stack(
        [
            ahead_m * math.sin(pose.heading_rad) + right_m * math.cos(pose.heading_rad),
            ahead_m * math.cos(pose.heading_rad) - right_m * math.sin(pose.heading_rad),
        ],
        axis=1,
    )
    uv, before = pixel_from_ground(lens, pose.rotation, pose.centre_m, world)
    turned = replace(pose, heading_rad=pose.heading_rad + math.radians(80))
    _, after = pixel_from_ground(lens, turned.rotation, turned.centre_m, world)
    assert before.all()
    assert not after.all()
    track = Trajectory(time_s=np.arange(21.0), uv=uv)
    seen = offset_trajectory(track, lens, pose, turned)
    assert 2 <= seen.time_s.size < after.sum()


def test_an_evaluation_reports_its_errors(tmp_path, lens, pose, monkeypatch):
    # Few walks: what is reported is right of a network that has learned little, too.
    monkeypatch.setattr(centred_run, "plan_training", tiny_plan)
    scene = load_scene(write_scene(tmp_path / "s", lens, pose))
    run = run_averaged(scene, recipe_name="default", seed=0, training_speed_mps=1.4, epochs=1)
    assert run.scene == "made-up"
    assert run.tracks == 40
    assert run.step_s == 0.4
    assert run.height_error_m == pytest.approx(abs(run.height_m - 6.0))
    expected = math.hypot(run.tilt_deg - 22, run.roll_deg - 1)
    assert run.served_angle_error_deg == pytest.approx(expected, rel=0.02)
