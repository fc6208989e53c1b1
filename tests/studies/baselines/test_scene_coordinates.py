"""DSAC++: exact where places are known; it learns them where pictures show them, else the mean."""

import math

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose

from models.errors import CalibrationError, TooFewTrajectoriesError
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose, pose_from_matrices
from models.regression.recipe import plan_training
from models.simulation.poses import PoseRange, random_poses, repeated_pose
from models.simulation.walkers import WalkConfig
from studies.baselines.differentiable_ransac import (
    best_pose,
    expected_loss,
    rotation_of,
    rotation_of_turn,
)
from studies.baselines.scene_coordinates import (
    mean_places_off,
    patch_pixels,
    patch_set,
    patches_of,
    pose_seen,
    train_end_to_end,
    train_places,
)

pytestmark = pytest.mark.slow

LENS = Intrinsics(width=960, height=540, fx=1600, fy=1600, cx=479.5, cy=269.5)
POSE = CameraPose(height_m=6.0, tilt_rad=math.radians(30), heading_rad=0.4, x_m=3.0, y_m=-2.0)
PLAN = plan_training(
    intrinsics=LENS, prior_pose=POSE, recipe_name="paper", walk=WalkConfig(), seed=0
)
BLACK = np.zeros((1, 54, 96), np.uint8)


def test_a_patch_has_its_middle_on_every_eighth_pixel():
    uv = patch_pixels(LENS, BLACK)
    assert uv.shape == (7 * 12, 2)
    assert_allclose(uv[0], [4.5, 4.5])  # the middle of the first of ten pixels
    assert_allclose(uv[-1], [10 * 88 + 4.5, 10 * 48 + 4.5])


def known_places():
    data = patches_of(LENS, BLACK, repeated_pose(POSE, 1))
    seen = data.on_ground[0].numpy()
    rays, _ = LENS.rays(patch_pixels(LENS, BLACK)[seen])
    return data.places_m[0].double().numpy()[seen] + (POSE.x_m, POSE.y_m, 0.0), rays[:, :2]


def test_known_places_are_the_pose_though_a_third_is_wrong():
    places, rays = known_places()
    rng = np.random.default_rng(2)
    places[::3] += rng.uniform(-3, 3, places[::3].shape)
    pose = best_pose(places, rays, 64, rng)
    found = pose_from_matrices(rotation_of_turn(pose[:3]), pose[3:])
    assert_allclose(found.centre_m, POSE.centre_m, atol=0.02)
    assert found.tilt_rad == pytest.approx(POSE.tilt_rad, abs=1e-3)


def test_three_points_are_no_pose():
    places, rays = known_places()
    with pytest.raises(TooFewTrajectoriesError, match="no 4 of 3 points"):
        best_pose(places[:3], rays[:3], 4, np.random.default_rng(0))


def test_the_expected_loss_falls_along_its_slope():
    places, rays = known_places()
    rng = np.random.default_rng(5)
    noisy = torch.tensor(places + rng.normal(0, 0.05, places.shape), requires_grad=True)

    def off(pose):
        centre = -(rotation_of(pose[:3]).T @ pose[3:])
        return torch.linalg.vector_norm(centre - torch.tensor(POSE.centre_m))

    loss = expected_loss(noisy, rays, off, 8, np.random.default_rng(1))
    torch.autograd.backward(loss)
    slope = noisy.grad
    step = 1e-3 / float(torch.linalg.vector_norm(slope))
    moved = (noisy - step * slope).detach()
    after = expected_loss(moved, rays, off, 8, np.random.default_rng(1))
    fallen = float(loss.detach() - after)
    assert fallen == pytest.approx(1e-3 * float(torch.linalg.vector_norm(slope)), rel=0.05)


def textured(count, rng):
    """Pictures in which every pixel is as bright as its place on the ground is far away."""
    near = PoseRange(height_m=1.0, angle_rad=math.radians(6))
    poses = random_poses(POSE, near, count, rng)
    images = np.zeros((count, 54, 96), np.uint8)
    uv = (np.stack(np.meshgrid(np.arange(96), np.arange(54)), -1).reshape(-1, 2) + 0.5) * 10 - 0.5
    for image, turn, centre in zip(images, poses.rotation, poses.centre_m, strict=True):
        rays = LENS.rays(uv)[0] @ turn
        away = np.linalg.norm(rays[:, :2] / np.maximum(-rays[:, 2:], 0.1), axis=1) * centre[2]
        image[:] = np.clip(10 * away, 0, 255).reshape(54, 96)
    return patches_of(LENS, images, poses)


def test_it_learns_a_toy_whose_pictures_show_their_places():
    rng = np.random.default_rng(7)
    data, held_out = textured(32, rng), textured(32, rng)
    constant, network = (train_places(data, epochs=epochs, seed=0) for epochs in (0, 25))
    assert mean_places_off(network, held_out) < 0.5 * mean_places_off(constant, held_out)


def test_of_black_pictures_it_learns_the_mean_place_and_no_pose():
    rng = np.random.default_rng(8)
    data, held_out = patch_set(PLAN, 64, rng), patch_set(PLAN, 64, rng)
    constant, network = (train_places(data, epochs=epochs, seed=0) for epochs in (0, 20))
    train_end_to_end(network, patch_set(PLAN, 6, rng), LENS, alpha=1.0, seed=0)
    assert mean_places_off(network, held_out) > 0.6 * mean_places_off(constant, held_out)
    away = []
    for image, centre in zip(held_out.images[:20].numpy(), held_out.poses.centre_m, strict=False):
        try:
            found = pose_seen(network, image, LENS, (POSE.x_m, POSE.y_m), rng)
        except CalibrationError:  # no pose, or one below the ground
            continue
        away.append(float(np.linalg.norm(found.centre_m - centre)))
    assert len(away) < 10 or np.mean(away) > 5  # metres, of a camera 6 m high
