"""The Python face: a camera's file and tracks in, whether it has moved and its pose out."""

import json
import math
import subprocess
import sys
import zipfile
from dataclasses import replace

import numpy as np
import pytest

import surefoot
from models.monitoring.drift import DriftLimits
from service.api.cameras import CameraBody
from service.settings import Settings
from studies.simulation.lanes import SiteConfig
from tests.conftest import ROOT, SCENES
from tests.models.sites import KNOCKED, LENS, PRIOR, tracks_of

LANES = SiteConfig(aside_m=0.8, standing_share=0.0)


@pytest.fixture(scope="module")
def camera():
    return surefoot.Camera(intrinsics=LENS, prior_pose=surefoot.Pose.of(PRIOR))


@pytest.fixture(scope="module")
def people():
    return tracks_of(3, (PRIOR, 200), (KNOCKED, 80), config=LANES)


@pytest.fixture(scope="module")
def site(camera, people):
    return surefoot.learn(camera, people[0])


def test_a_knock_is_told_with_the_pose_and_intervals_that_hold_it(site, people):
    result = surefoot.estimate(site, people[1])
    assert result.moved
    assert "tilt" in result.why
    truth = surefoot.Pose.of(KNOCKED)
    intervals = result.intervals(0.999)
    assert set(intervals) == {"tilt_deg", "roll_deg", "height_m", "heading_deg"}
    for name, (low, high) in intervals.items():
        assert low < getattr(truth, name) < high, name
    narrow = result.intervals(0.9)["tilt_deg"]
    assert narrow[1] - narrow[0] == pytest.approx(2 * 1.6449 * result.sd["tilt_deg"], rel=1e-2)
    moved_by = truth.tilt_deg - surefoot.Pose.of(PRIOR).tilt_deg
    assert result.drift["tilt_deg"] == pytest.approx(moved_by, abs=1)


def test_places_have_ellipses_that_hold_the_truth_and_a_way_back(camera, site, people):
    result = surefoot.estimate(site, people[1])
    uv = [(400.0, 500.0), (640.0, 600.0), (900.0, 450.0), (640.0, -5000.0)]
    found = surefoot.ground(camera, uv, result.pose)
    true = surefoot.ground(camera, uv, surefoot.Pose.of(KNOCKED))
    sizes = surefoot.ellipses(camera, uv, result)
    assert (found[3], sizes[3]) == (None, None)
    for (x, y), (to_x, to_y), (major, minor, angle) in zip(
        found[:3], true[:3], sizes[:3], strict=True
    ):
        along = np.array([math.sin(math.radians(angle)), math.cos(math.radians(angle))])
        off = np.array([to_x - x, to_y - y])
        aside = float(np.hypot(*(off - off @ along * along)))
        assert math.hypot(off @ along / major, aside / minor) < 3.5
    back = surefoot.image(camera, found[:3], result.pose)
    assert np.allclose(back, uv[:3], atol=1e-6)
    assert surefoot.image(camera, [(1e4, -1e4)]) == [None]


def test_a_camera_that_stands_has_not_moved(camera):
    known, after = tracks_of(5, (PRIOR, 200), (PRIOR, 80), config=LANES)
    result = surefoot.estimate(surefoot.learn(camera, known), after)
    assert not result.moved
    assert result.pose.tilt_deg == pytest.approx(camera.prior_pose.tilt_deg, abs=1)


def test_tracks_may_come_in_any_order(camera, site, people):
    known, after = (list(np.random.default_rng(1).permutation(part)) for part in people)
    again = surefoot.learn(camera, known)
    assert surefoot.estimate(again, after) == surefoot.estimate(site, people[1])


def test_a_site_is_kept_in_a_file(site, people, tmp_path):
    site.save(tmp_path / "gate.site")
    kept = surefoot.read_site(tmp_path / "gate.site")
    assert kept.camera == site.camera
    one, other = (surefoot.estimate(each, people[1]) for each in (site, kept))
    assert other.moved == one.moved
    assert other.pose.tilt_deg == pytest.approx(one.pose.tilt_deg, abs=1e-3)  # kept rounded
    (tmp_path / "torn.site").write_bytes((tmp_path / "gate.site").read_bytes()[:-300])
    with pytest.raises(surefoot.CalibrationError, match="torn.site: no site of ours"):
        surefoot.read_site(tmp_path / "torn.site")


def test_too_few_people_are_said(camera, people):
    with pytest.raises(surefoot.CalibrationError, match="5"):
        surefoot.learn(camera, people[0][:3])


def test_a_camera_is_read_of_a_registration(tmp_path):
    lens = {"width": 1280, "height": 720, "fx": 900, "fy": 900, "cx": 639.5, "cy": 359.5}
    body = {"id": "gate", "intrinsics": lens, "prior_pose": {"height_m": 5, "tilt_deg": 45}}
    path = tmp_path / "camera.json"
    path.write_text(json.dumps(body))
    camera = surefoot.read_camera(path)
    # Straight ahead at 45 deg below the horizon: as far as the camera is high; north is +Y.
    middle, above = surefoot.ground(camera, [(639.5, 359.5), (639.5, -5000.0)])
    assert middle == pytest.approx((0.0, 5.0), abs=1e-9)
    assert above is None
    for wrong, message in (
        ({**body, "prior_pose": {"height_m": 5}}, "tilt_deg"),
        ({**body, "prior_pose": {"height_m": -5, "tilt_deg": 4}}, "height_m: must be above 0"),
        ({"intrinsics": lens}, "prior_pose: height_m and tilt_deg are needed"),
        ({**body, "lens": {}}, "one of both"),
        ({"prior_pose": body["prior_pose"]}, "one of both"),
        ({"prior_pose": body["prior_pose"], "lens": {"hfov_deg": 90}}, "width"),
    ):
        path.write_text(json.dumps(wrong))
        with pytest.raises(surefoot.CalibrationError, match=message):
            surefoot.read_camera(path)


@pytest.mark.parametrize(
    "told",
    [
        {"hfov_deg": 70.0},
        {"focal_mm": 4.0, "sensor_mm": [5.76, 3.24]},
        {"fisheye": {"fx": 500.0, "distortion": [0.01, 0.0, 0.0, 0.0]}},
    ],
)
def test_a_lens_is_told_as_the_service_takes_it(tmp_path, told):
    body = {"lens": {"width": 1920, "height": 1080, **told}}
    body["prior_pose"] = {"height_m": 5.0, "tilt_deg": 45.0}
    path = tmp_path / "camera.json"
    path.write_text(json.dumps(body))
    camera = surefoot.read_camera(path)
    stored = CameraBody.model_validate(body).lens_value()
    assert camera.intrinsics == stored
    path.write_text(camera.as_json())
    assert surefoot.read_camera(path) == camera


def test_tracks_are_read_of_mot_text_and_of_feet(tmp_path):
    mot = tmp_path / "mot.txt"
    rows = [f"{1 + 10 * n},7,{100 + n},50,21,80,1,-1,-1,-1" for n in range(6)]
    mot.write_text("\n".join([*reversed(rows), "1,8,5,5,20,80,1,-1,-1,-1", ""]))
    (track,) = surefoot.read_tracks(mot, frame_rate_hz=25, started_at_s=1000.0)  # one is too short
    np.testing.assert_allclose(track.time_s, 1000 + 0.4 * np.arange(6))
    np.testing.assert_allclose(track.uv[0], [100 - 1 + 10.5, 50 - 1 + 80])  # they count from 1
    assert track.top_v[0] == 49
    with pytest.raises(surefoot.CalibrationError, match="frame_rate_hz: is needed"):
        surefoot.read_tracks(mot)
    feet = tmp_path / "feet.csv"
    lines = [f"7,{time_s},{u},{v}" for time_s, (u, v) in zip(track.time_s, track.uv, strict=True)]
    feet.write_text("\n".join(["track_id,time_s,u_px,v_px", *lines]))
    (same,) = surefoot.read_tracks(feet)
    np.testing.assert_allclose(same.uv, track.uv)
    feet.write_text("nothing of the kind")
    with pytest.raises(surefoot.CalibrationError, match="header: missing id"):
        surefoot.read_tracks(feet, frame_rate_hz=25)


@pytest.mark.skipif(not SCENES.is_dir(), reason=f"no recorded scenes in {SCENES}")
def test_recorded_people_in_five_lines():
    camera = surefoot.read_camera(SCENES / "wildtrack_c1" / "camera.json")
    tracks = surefoot.read_tracks(SCENES / "wildtrack_c1" / "tracks.csv")
    site = surefoot.learn(camera, tracks[:130])
    result = surefoot.estimate(site, tracks[130:])
    assert not result.moved
    assert result.pose.height_m == pytest.approx(camera.prior_pose.height_m, rel=0.1)
    for name, (low, high) in result.intervals(0.99).items():
        assert low < getattr(camera.prior_pose, name) < high, name


def test_it_brings_neither_torch_nor_the_service():
    program = "import sys, surefoot; print(sorted({'torch', 'service', 'cv2'} & set(sys.modules)))"
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert done.stdout.strip() == "[]"


def test_a_pose_keeps_its_angles():
    pose = surefoot.Pose(height_m=4, tilt_deg=20, roll_deg=-3, heading_deg=300)
    assert surefoot.Pose.of(pose.in_radians).heading_deg == pytest.approx(300)
    assert pose.in_radians.tilt_rad == pytest.approx(math.radians(20))


def test_a_drift_counts_from_where_the_service_counts_it():
    limits, ours = DriftLimits(), Settings.model_fields
    assert ours["drift_certainty"].default == limits.certainty
    assert math.radians(ours["drift_floor_deg"].default) == limits.floor_rad
    assert ours["drift_floor_m"].default == limits.floor_m
    assert ours["drift_people"].default == limits.people
    assert ours["drift_clear_ratio"].default == limits.clear_ratio


def test_too_few_people_make_no_estimate(site, people):
    for few in ([], people[1][:4]):
        with pytest.raises(surefoot.CalibrationError, match=f"5 people.*got {len(few)}"):
            surefoot.estimate(site, few)


def test_a_heading_is_in_its_interval_whatever_the_turn(site, people):
    result = surefoot.estimate(site, people[1])
    prior = replace(result.posterior.prior, heading_rad=math.radians(359.0))
    posterior = replace(result.posterior, prior=prior)
    pose = replace(result.pose, heading_deg=359.0 + math.degrees(posterior.offset[3]) - 360.0)
    turned = replace(result, pose=pose, posterior=posterior, estimated=("heading_deg",))
    low, high = turned.intervals(0.9)["heading_deg"]
    assert low <= pose.heading_deg <= high


@pytest.mark.parametrize(
    "wrong",
    [
        5,
        [1],
        {"prior_pose": {"height_m": "6", "tilt_deg": 18}},
        {"prior_pose": {"height_m": None, "tilt_deg": 18}},
        {"prior_pose": [6, 18]},
        {"lens": {"width": 1280, "height": 720, "hfov_deg": 0}},
        {"lens": {"width": 0, "height": 720, "focal_mm": 4, "sensor_mm": [5, 3]}},
        {"lens": {"width": 1280, "height": 720, "fisheye": 5}},
    ],
)
def test_what_is_no_camera_is_said_by_an_error_of_ours(tmp_path, wrong):
    lens = {"width": 1280, "height": 720, "fx": 900, "fy": 900, "cx": 639.5, "cy": 359.5}
    body = {"prior_pose": {"height_m": 5, "tilt_deg": 45}, "intrinsics": lens}
    if isinstance(wrong, dict):
        kept = {} if "lens" in wrong else {"intrinsics": lens}
        wrong = {"prior_pose": body["prior_pose"], **kept, **wrong}
    path = tmp_path / "camera.json"
    path.write_text(json.dumps(wrong))
    with pytest.raises(surefoot.CalibrationError, match="camera.json|prior_pose"):
        surefoot.read_camera(path)


def test_tracks_and_sites_that_are_none_are_said_by_errors_of_ours(camera, tmp_path):
    feet = tmp_path / "feet.csv"
    feet.write_text("track_id,time_s,u_px,v_px\na,0.0,100,200\na,0.5,108\n")
    assert surefoot.read_tracks(feet).rejected == {"malformed": 1}
    with pytest.raises(surefoot.CalibrationError, match="none.csv: No such file"):
        surefoot.read_tracks(tmp_path / "none.csv")
    with zipfile.ZipFile(tmp_path / "bare.site", "w") as file:
        file.writestr("camera.json", camera.as_json())
    with pytest.raises(surefoot.CalibrationError, match="bare.site: no site of ours"):
        surefoot.read_site(tmp_path / "bare.site")


def test_a_box_that_the_border_cuts_has_no_top_and_a_mark_of_bytes_no_meaning(tmp_path):
    mot = tmp_path / "mot.txt"
    rows = [f"{1 + 10 * n},7,100,{3 - n if n < 3 else 9},21,{80 + n},1" for n in range(6)]
    mot.write_text("\ufeff" + "\n".join(rows), encoding="utf-8")
    (track,) = surefoot.read_tracks(mot, frame_rate_hz=25)
    np.testing.assert_array_equal(track.top_v, [2, np.nan, np.nan, 8, 8, 8])
