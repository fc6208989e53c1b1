"""Ellipses of points by the error of a pose: against draws of poses, and what is pinned."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from models.geometry.ground import ground_from_pixel, ground_of_rays, pixel_from_ground
from models.geometry.pose import CameraPose, array_of
from models.geometry.propagation import error_ellipses
from models.geometry.rotation import rotation_from_angles

# Tilt and height of an estimate by walking speeds lean on each other.
SD = np.array([math.radians(0.2), math.radians(0.3), 0.02, math.radians(0.25)])
LEAN = np.array([[1, 0.2, 0.8, 0], [0.2, 1, 0, -0.3], [0.8, 0, 1, 0], [0, -0.3, 0, 1.0]])
COVARIANCE = SD[:, None] * LEAN * SD


def placed_by(lens, pose, uv):
    rays, _ = lens.rays(uv)

    def placed(rotation, height_m):
        return pose.centre_m[:2] + height_m * ground_of_rays(rays, rotation)[0]

    return placed


def drawn(placed, pose, count=20_000):
    values = np.random.default_rng(3).multivariate_normal(array_of(pose), COVARIANCE, count)
    return np.array([placed(rotation_from_angles(t, r, h), math.exp(g)) for t, r, g, h in values])


def test_an_ellipse_is_that_of_poses_that_are_drawn(lens, pose):
    warped = replace(lens, distortion=(-0.2, 0.05, 0.001, -0.002, 0.0))
    uv = np.array([[200.0, 400.0], [640.0, 650.0], [1100.0, 300.0]])
    placed = placed_by(warped, pose, uv)
    ellipses = error_ellipses(placed, pose, COVARIANCE)
    cloud = drawn(placed, pose)
    for number, (major, minor, angle) in enumerate(ellipses):
        variances, axes = np.linalg.eigh(np.cov(cloud[:, number].T))
        assert_allclose([minor, major], np.sqrt(variances), rtol=0.04)
        along = np.array([math.cos(angle), math.sin(angle)])
        assert abs(along @ axes[:, 1]) > math.cos(math.radians(3))
        # 95 of 100 are within 2.45 of it.
        turned = (cloud[:, number] - placed(pose.rotation, pose.height_m)[number]) @ np.array(
            [[along[0], -along[1]], [along[1], along[0]]]
        )
        within = (turned**2 / np.array([major, minor]) ** 2).sum(axis=1) <= 5.991
        assert within.mean() == pytest.approx(0.95, abs=0.01)


def test_correlations_count(lens, pose):
    placed = placed_by(lens, pose, np.array([[640.0, 500.0]]))
    together = error_ellipses(placed, pose, COVARIANCE)[0, 0]
    apart = error_ellipses(placed, pose, np.diag(np.diag(COVARIANCE)))[0, 0]
    # A camera that is higher and looks down more sees a pixel at nearly the same distance.
    assert together < 0.8 * apart


def test_a_camera_that_turns_moves_what_is_far_sideways():
    pose = CameraPose(height_m=5.0, tilt_rad=math.radians(20))
    heading = np.diag([0, 0, 0, math.radians(1.0) ** 2])

    def placed(rotation, height_m):
        ray = np.array([[0.0, 0.0, 1.0]])
        return height_m * ground_of_rays(ray, rotation)[0]

    ((major, minor, angle),) = error_ellipses(placed, pose, heading)
    away_m = 5.0 / math.tan(math.radians(20))
    assert_allclose(major, away_m * math.radians(1.0), rtol=1e-6)
    assert_allclose([minor, angle], 0.0, atol=1e-6)  # along +X, right of where it looks


def test_pixels_of_places_are_as_unsure_as_their_places(lens, pose):
    """The same error, seen in the picture: by the homography's derivative at the point."""
    uv = np.array([[700.0, 420.0]])
    ground, _ = ground_from_pixel(lens, pose.rotation, pose.centre_m, uv)

    def seen(rotation, height_m):
        centre = np.array([pose.x_m, pose.y_m, height_m])
        return pixel_from_ground(lens, rotation, centre, ground)[0]

    in_picture = error_ellipses(seen, pose, COVARIANCE)[0]
    on_ground = error_ellipses(placed_by(lens, pose, uv), pose, COVARIANCE)[0]
    step = np.eye(2) * 1e-4
    moved, _ = ground_from_pixel(lens, pose.rotation, pose.centre_m, uv + step)
    area = abs(np.linalg.det((moved - ground) / 1e-4))
    assert_allclose(on_ground[0] * on_ground[1], in_picture[0] * in_picture[1] * area, rtol=1e-3)


def test_above_the_horizon_there_is_none(lens, pose):
    placed = placed_by(lens, pose, np.array([[640.0, -500.0], [640.0, 600.0]]))
    found = error_ellipses(placed, pose, COVARIANCE)
    assert np.isnan(found[0]).all()
    assert np.isfinite(found[1]).all()
