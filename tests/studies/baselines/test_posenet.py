"""PoseNet on walks: it learns what a picture shows, and no picture shows how fast they go."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
import torch
from numpy.testing import assert_array_equal

from models.geometry.ground import pixel_from_ground
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.regression.recipe import plan_training
from models.simulation.poses import PoseRange
from models.simulation.walkers import WalkConfig, Walks
from studies.baselines import posenet
from studies.baselines.posenet import TrajectoryPoseNet, draw_walks, parameters_of, train_posenet

pytestmark = pytest.mark.slow

LENS = Intrinsics(width=960, height=540, fx=800, fy=800, cx=479.5, cy=269.5)
POSE = CameraPose(height_m=6.0, tilt_rad=math.radians(25))
PLAN = plan_training(
    intrinsics=LENS, prior_pose=POSE, recipe_name="paper", walk=WalkConfig(), seed=0
)
ROW = np.stack([np.linspace(-4, 4, 9), np.full(9, 12.0)], axis=-1)


def test_a_walk_is_a_line_between_the_middles_of_its_pixels():
    uv = np.array([[[4.5, 104.5], [954.5, 104.5], [np.nan, np.nan]]])
    (image,) = draw_walks(uv, LENS)
    assert image.shape == (54, 96)
    # Ten pixels are one: the eleventh row of ten has rows 100 to 109 in it.
    assert_array_equal(np.flatnonzero(image.any(axis=1)), [10])
    assert (image[10] == 255).all()


def test_a_picture_has_no_speed():
    """Twice as many points on the same line are somebody half as fast: the picture is the same."""
    fast = np.linspace([100.0, 200.0], [700.0, 400.0], 11)
    slow = np.linspace([100.0, 200.0], [700.0, 400.0], 21)
    images = [draw_walks(walk[None], LENS)[0] for walk in (fast, slow)]
    # A hair of rounding to sixteenths of a pixel may move the line's middle by one.
    wider = [cv2.dilate(image, np.ones((3, 3), np.uint8)) for image in images]
    assert not (images[0] & ~wider[1]).any()
    assert not (images[1] & ~wider[0]).any()


@pytest.fixture
def toy(monkeypatch):
    """One row of people, always the same: where it lies in the picture tells height and tilt."""

    def same_row(intrinsics, poses, config, rng):
        uv, valid = pixel_from_ground(
            intrinsics, poses.rotation, poses.centre_m, np.broadcast_to(ROW, (len(poses), 9, 2))
        )
        kept = np.flatnonzero(valid.all(axis=1) & intrinsics.contains(uv).all(axis=1))
        return Walks(uv=uv[kept], lengths=np.full(kept.size, 9), pose_idx=kept)

    monkeypatch.setattr(posenet, "simulate_walks", same_row)
    monkeypatch.setattr(posenet, "_BATCH", 8)
    near = PoseRange(height_step_m=1.0, angle_rad=math.radians(2))
    plan = replace(PLAN, recipe=replace(PLAN.recipe, walks_per_pose=2, spread=near))
    return plan, posenet._image_set(plan, posenet.grid_poses(POSE, near), np.random.default_rng(1))


def loss_of(output, data):
    return float(posenet.pose_loss(output, data.height_m, data.quaternion, 10.0))


def test_a_few_steps_bring_it_nearer(toy):
    plan, data = toy
    network = train_posenet(plan, alpha=10.0, epochs=3)
    with torch.inference_mode():
        fresh, learned = (
            loss_of(each(data.images), data) for each in (TrajectoryPoseNet(54).eval(), network)
        )
    assert learned < 0.7 * fresh


def test_it_learns_a_toy(toy):
    plan, data = toy
    network = train_posenet(plan, alpha=10.0, epochs=16)
    with torch.inference_mode():
        learned = loss_of(network(data.images), data)
    middle = torch.cat([data.height_m.median()[None], data.quaternion.mean(dim=0)])
    assert learned < 0.5 * loss_of(middle.expand(len(data.images), 5), data)


def test_its_size_is_what_its_layers_say():
    network = TrajectoryPoseNet(54)
    # 3 x 3 kernels and a bias an output: 1-16-32-64-64-128; then 128 x 2 x 3 to 256 to 5.
    convolutions = 16 * 10 + 32 * 145 + 64 * 289 + 64 * 577 + 128 * 577
    assert parameters_of(network) == convolutions + 256 * (768 + 1) + 5 * 257
