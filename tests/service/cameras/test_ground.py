"""`/cameras/{id}/ground` and `/image`: places by the pose that held, and back."""

import math
from datetime import UTC, datetime

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from service.cameras.held_poses import held_pose
from service.store.engines.store import Store
from tests.conftest import CAMERA
from tests.service.bench import PRIOR, moved
from tests.service.conftest import problem

GROUND, IMAGE = "/cameras/corner/ground", "/cameras/corner/image"
TURNED = moved(tilt_deg=4)
FEET = [[300.0, 400.0], [640.0, 650.0], [1200.0, 500.0]]


def ask(http, points, url=GROUND, **others):
    return http.post(url, json={"points": points, **others}).raise_for_status().json()


def places(answer):
    return np.array([[each["x_m"], each["y_m"]] for each in answer["points"]])


def by_opencv(uv, pose=PRIOR, distortion=(0.0,) * 5):
    """Where rays of OpenCV's undistorted pixels meet the ground."""
    fx, cx, cy = 1100, 639.5, 359.5
    matrix = np.array([[fx, 0, cx], [0, fx, cy], [0, 0, 1.0]])
    flat = cv2.undistortPoints(np.array(uv, float)[:, None], matrix, np.array(distortion))[:, 0]
    world = np.column_stack([flat, np.ones(len(flat))]) @ pose.rotation
    return pose.centre_m[:2] - pose.height_m * world[:, :2] / world[:, 2:]


def test_pixels_are_placed_as_opencv_places_them(corner):
    answer = ask(corner, FEET)
    assert_allclose(places(answer), by_opencv(FEET), atol=1e-9)
    assert answer["by"]["drifted"] is False
    assert answer["by"]["pose"]["tilt_deg"] == pytest.approx(22)


def test_a_lens_bends_and_it_is_taken_out(http):
    bent = [-0.3, 0.1, 0.001, -0.002, 0.0]
    lens = {**CAMERA["intrinsics"], "distortion": bent}
    http.post("/cameras", json={**CAMERA, "intrinsics": lens}).raise_for_status()
    found = places(ask(http, FEET))
    # OpenCV's own iteration stops at some 1e-4 px.
    assert_allclose(found, by_opencv(FEET, distortion=bent), atol=0.02)
    back = ask(http, found.tolist(), IMAGE)
    assert_allclose([[p["u"], p["v"]] for p in back["points"]], FEET, atol=1e-6)


def test_what_is_no_ground_is_null_and_the_way_back_is_exact(corner):
    answer = ask(corner, [[640, -400], *FEET])
    assert answer["points"][0] is None
    back = ask(corner, [[p["x_m"], p["y_m"]] for p in answer["points"][1:]], IMAGE)
    assert_allclose([[p["u"], p["v"]] for p in back["points"]], FEET, atol=1e-8)
    behind = -30 * np.array([math.sin(PRIOR.heading_rad), math.cos(PRIOR.heading_rad)])
    assert ask(corner, [behind.tolist()], IMAGE)["points"] == [None]


def test_before_an_estimate_nobody_says_how_sure_it_is(corner):
    assert {p["sd_m"] for p in ask(corner, FEET)["points"]} == {None}


def test_the_pose_is_the_one_that_held(bench):
    """Prior until it moved, drifted from its change on, accepted after; each by its own time."""
    bench.see(PRIOR)
    still = bench.clock_s + 30
    bench.see(TURNED, change=5)
    alert = bench.alerts(state="firing")[0]
    change = datetime.fromisoformat(alert["changed_at"]).timestamp()
    assert still < change
    for at, pose in ((still, PRIOR), (change - 1, PRIOR), (change + 1, TURNED)):
        answer = ask(bench.http, FEET, at=datetime.fromtimestamp(at, UTC).isoformat())
        assert answer["by"]["drifted"] == (pose is TURNED)
        assert_allclose(places(answer), by_opencv(FEET, pose), rtol=0.01)
    now = ask(bench.http, FEET)
    served = bench.pose()
    assert now["by"]["drifted"] is True
    assert now["by"]["pose"] == served["pose"]
    assert now["by"]["estimated"] == served["estimated"]
    bench.http.post("/cameras/corner/pose/accept").raise_for_status()
    accepted = ask(bench.http, FEET)
    assert accepted["by"]["drifted"] is False
    assert accepted["by"]["pose"] == served["pose"]
    again = ask(bench.http, FEET, at=datetime.fromtimestamp(still, UTC).isoformat())
    assert_allclose(places(again), by_opencv(FEET), atol=1e-9)


def test_a_camera_that_was_put_back_is_at_its_prior_pose_again(bench):
    bench.see(TURNED, change=5)
    meanwhile = datetime.fromtimestamp(bench.clock_s + 30, UTC).isoformat()
    bench.http.post("/cameras/corner/pose/put-back").raise_for_status()
    assert ask(bench.http, FEET)["by"]["drifted"] is False
    assert ask(bench.http, FEET, at=meanwhile)["by"]["drifted"] is True


def test_after_a_false_alarm_it_has_never_moved(bench):
    bench.see(TURNED, change=5)
    (alert,) = bench.alerts(state="firing")
    said = {"outcome": "false_alarm"}
    bench.http.post(f"/alerts/{alert['id']}/resolve", json=said).raise_for_status()
    later = datetime.fromtimestamp(bench.clock_s + 30, UTC).isoformat()
    assert ask(bench.http, FEET, at=later)["by"]["drifted"] is False


def test_a_wrong_clock_moves_no_camera(bench):
    bench.see(moved(height_m=2.0))
    assert bench.alerts(state="firing")[0]["kind"] == "clock"
    assert ask(bench.http, FEET)["by"]["drifted"] is False


def test_ellipses_are_of_the_posterior_with_its_correlations(bench):
    """Against draws of the pose by what is stored, through OpenCV's geometry."""
    bench.see(moved(tilt_deg=4, roll_deg=2), change=5, paths=True)
    answer = ask(bench.http, FEET)
    with Store(bench.settings).read() as session:
        held = held_pose(session, "corner")
    assert set(held.identifiable) == {"tilt", "roll", "height", "heading"}
    assert (np.diag(held.own) > 0).all()
    rng = np.random.default_rng(0)
    offsets = rng.multivariate_normal(np.zeros(4), held.own, 4000)
    pose = held.pose
    cloud = np.array([by_opencv(FEET, turned(pose, *each)) for each in offsets])
    for number, point in enumerate(answer["points"]):
        major, minor, angle = point["sd_m"]
        variances, axes = np.linalg.eigh(np.cov(cloud[:, number].T))
        assert_allclose([minor, major], np.sqrt(variances), rtol=0.06)
        along = np.array([math.sin(math.radians(angle)), math.cos(math.radians(angle))])
        assert abs(along @ axes[:, 1]) > 0.99
    bench.http.post("/cameras/corner/pose/accept").raise_for_status()
    # The new prior pose is no surer than it was.
    kept = ask(bench.http, FEET)["points"]
    assert [p["sd_m"] for p in kept] == [p["sd_m"] for p in answer["points"]]


def turned(pose, tilt, roll, log_height, heading):
    return type(pose)(
        height_m=pose.height_m * math.exp(log_height),
        tilt_rad=pose.tilt_rad + tilt,
        roll_rad=pose.roll_rad + roll,
        heading_rad=pose.heading_rad + heading,
    )


@pytest.mark.parametrize(
    ("body", "pointer"),
    [
        ({"points": [[1, 2]] * 10_001}, "/points"),
        ({"points": [[1, 2, 3]]}, "/points/0"),
        ({"points": [[1, "x"]]}, "/points/0/1"),
        ({"points": [[1, 1e300]]}, "/points/0/1"),
        ({}, "/points"),
        ({"points": [], "at": "yesterday"}, "/at"),
    ],
)
def test_what_is_refused_is_named(corner, body, pointer):
    told = problem(corner.post(GROUND, json=body), 422, "malformed")
    assert told["errors"][0]["pointer"] == pointer


def test_no_camera_is_told_and_no_points_are_none(corner):
    problem(corner.post("/cameras/none/ground", json={"points": []}), 404, "not_found")
    assert ask(corner, [])["points"] == []
    assert len(ask(corner, [[640, 500]] * 10_000)["points"]) == 10_000
