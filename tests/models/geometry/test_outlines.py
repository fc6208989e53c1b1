"""Outlines after a move: against OpenCV, at the horizon, behind the camera, out of the picture."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from models.geometry.drawn_outlines import clipped, inside
from models.geometry.ground import ground_from_pixel, pixel_from_ground
from models.geometry.outlines import Outline, View, moved_outlines, within_picture
from models.geometry.pose import CameraPose

GATE = np.array([[400.0, 350.0], [800.0, 360.0], [900.0, 600.0], [350.0, 580.0]])


def turned(pose, tilt=0.0, roll=0.0, heading=0.0, height_m=0.0):
    return replace(
        pose,
        tilt_rad=pose.tilt_rad + math.radians(tilt),
        roll_rad=pose.roll_rad + math.radians(roll),
        heading_rad=pose.heading_rad + math.radians(heading),
        height_m=pose.height_m + height_m,
    )


def outline(lens, pose, corners=GATE, *, on_ground=True):
    drawn = View(intrinsics=lens, pose=pose)
    return Outline(corners=np.array(corners, float), drawn=drawn, on_ground=on_ground)


def after(of, pose, covariance=None):
    return moved_outlines([of], View(intrinsics=of.drawn.intrinsics, pose=pose), covariance)[0]


@pytest.mark.parametrize("distortion", [(0.0,) * 5, (-0.25, 0.08, 0.001, -0.001, 0.0)])
def test_corners_on_the_ground_are_where_opencv_sees_them(lens, pose, distortion):
    bent = replace(lens, distortion=distortion)
    now = turned(pose, tilt=3, roll=-4, heading=2, height_m=-0.5)
    ground, _ = ground_from_pixel(bent, pose.rotation, pose.centre_m, GATE)
    points = np.column_stack([ground, np.zeros(4)])
    seen, _ = cv2.projectPoints(
        points,
        cv2.Rodrigues(now.rotation)[0],
        now.translation_m,
        bent.matrix,
        np.array(distortion),
    )
    assert_allclose(after(outline(bent, pose), now).corners, seen[:, 0], atol=1e-5)


def test_the_rest_goes_by_the_rotation_alone(lens, pose):
    now = turned(pose, tilt=3, roll=-4, heading=2, height_m=-0.5)
    turn = lens.matrix @ now.rotation @ pose.rotation.T @ np.linalg.inv(lens.matrix)
    expected = cv2.perspectiveTransform(GATE[None], turn)[0]
    found = after(outline(lens, pose, on_ground=False), now)
    assert_allclose(found.corners, expected, atol=1e-8)


def test_where_nothing_moved_everything_is_where_it_was(lens, pose):
    of = outline(lens, pose)
    found = after(of, pose)
    assert_allclose(found.corners, GATE, atol=1e-9)
    assert found.in_view == 1.0
    assert found.overlap == 1.0


def test_what_was_drawn_above_the_horizon_is_no_ground(lens):
    pose = CameraPose(height_m=6.0, tilt_rad=math.radians(5))
    horizon_v = 359.5 - 1100 * math.tan(math.radians(5))
    found = after(outline(lens, pose, [[500, 100], [700, 100], [700, 500], [500, 500]]), pose)
    assert len(found.corners) == 4
    assert found.corners[:, 1].min() == pytest.approx(horizon_v, abs=6)
    assert found.corners[:, 1].min() > horizon_v
    sky = after(outline(lens, pose, [[500, 10], [700, 10], [700, 200]]), pose)
    assert (len(sky.corners), sky.in_view) == (0, 0.0)


def test_what_comes_to_lie_behind_the_camera_is_cut_there(lens):
    """Around its foot on both sides: in the picture that would turn inside out."""
    down = CameraPose(height_m=6.0, tilt_rad=math.radians(80))
    of = outline(lens, down, [[100, 5], [1200, 5], [1200, 715], [100, 715]])
    found = after(of, replace(down, tilt_rad=math.radians(-5)))
    # All that is left is below the horizon, in front.
    assert found.in_view == 0.0
    level = replace(down, tilt_rad=math.radians(20))
    found = after(of, level)
    assert len(found.corners) >= 3
    assert np.isfinite(found.corners).all()
    ground, hits = ground_from_pixel(lens, level.rotation, level.centre_m, found.corners)
    assert hits.all()
    back, valid = pixel_from_ground(lens, down.rotation, down.centre_m, ground)
    assert valid.all()
    assert inside(back, of.corners + [[-1, -1], [1, -1], [1, 1], [-1, 1]], 0.0).all()
    behind = replace(down, heading_rad=math.pi, tilt_rad=math.radians(5))
    assert len(after(outline(lens, replace(down, tilt_rad=0.1)), behind).corners) == 0


def test_a_lens_that_folds_back_shows_nothing_from_beyond(lens, pose):
    folding = replace(lens, distortion=(-0.6, 0.0, 0.0, 0.0, 0.0))
    found = after(outline(folding, pose), turned(pose, heading=40))
    assert np.isfinite(found.corners).all()


def test_shares_are_those_of_areas(lens):
    """Straight down the picture is a map: a move by a quarter of a square leaves three."""
    down = CameraPose(height_m=10.0, tilt_rad=math.pi / 2)
    square = [[540, 260], [740, 260], [740, 460], [540, 460]]
    of = outline(lens, down, square)
    aside_m = 50 / 1100 * 10
    now = View(intrinsics=lens, pose=replace(down, x_m=aside_m))
    (found,) = moved_outlines([of], now, None)
    assert found.overlap == pytest.approx(0.75, abs=0.02)
    assert found.in_view == 1.0
    far = View(intrinsics=lens, pose=replace(down, x_m=640 / 1100 * 10))
    (found,) = moved_outlines([of], far, None)
    assert found.in_view == pytest.approx(0.5, abs=0.02)
    assert found.overlap == 0.0


def test_a_line_is_a_line(lens, pose):
    line = outline(lens, pose, [[300, 500], [900, 520]])
    found = after(line, turned(pose, tilt=1))
    assert found.corners.shape == (2, 2)
    assert after(line, pose).overlap == 1.0
    assert after(line, turned(pose, tilt=5)).overlap < 0.1
    gone = after(line, turned(pose, heading=150))
    assert (len(gone.corners), gone.in_view) == (0, 0.0)


@pytest.mark.nightly
def test_ellipses_are_those_of_poses_that_are_drawn(lens, pose):
    sd = np.array([math.radians(0.3), math.radians(0.2), 0.02, math.radians(0.2)])
    covariance = np.diag(sd**2)
    covariance[0, 2] = covariance[2, 0] = 0.7 * sd[0] * sd[2]
    now = turned(pose, tilt=2)
    for on_ground in (True, False):
        of = outline(lens, pose, on_ground=on_ground)
        found = after(of, now, covariance)
        offsets = np.random.default_rng(0).multivariate_normal(np.zeros(4), covariance, 1500)
        cloud = np.array(
            [
                after(
                    of,
                    replace(
                        now,
                        tilt_rad=now.tilt_rad + tilt,
                        roll_rad=now.roll_rad + roll,
                        height_m=now.height_m * math.exp(log_height),
                        heading_rad=now.heading_rad + heading,
                    ),
                ).corners
                for tilt, roll, log_height, heading in offsets
            ]
        )
        for number, (major, minor, _) in enumerate(found.ellipses):
            variances = np.linalg.eigvalsh(np.cov(cloud[:, number].T))
            assert_allclose([minor, major], np.sqrt(variances), rtol=0.08)


def test_a_picture_cuts_what_is_beyond_it(lens):
    found = within_picture(np.array([[-100.0, 100], [300, 100], [300, 200], [-100, 200]]), lens,
                           closed=True)  # fmt: skip
    assert sorted(map(tuple, found)) == [(-0.5, 100), (-0.5, 200), (300, 100), (300, 200)]
    assert not len(within_picture(np.array([[-100.0, 1], [-50, 1], [-60, 9]]), lens, closed=True))
    assert clipped(np.zeros((0, 3)), np.eye(3), closed=True).shape == (0, 3)
