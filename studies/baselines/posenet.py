"""PoseNet: a convolutional network that reads a walk as a picture, white on black.

The baseline of Xu et al. 2020, table 1, after Kendall, Grimes and Cipolla 2015, as small as is
honest: five strided convolutions (16 to 128 channels) and two dense layers in place of GoogLeNet,
since there is no texture to see; no weights are downloaded. A picture is 96 pixels wide, which is a
quarter to a twentieth of the lens's: a walk is then a line of one pixel, and its points, by which
its speed could be told, are gone. That is the method's, not the picture's size.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn

from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array, quaternion_from_rotation
from models.regression.network import pose_from_output, pose_loss
from models.regression.recipe import TrainingPlan
from models.simulation.poses import PoseSet, grid_poses
from models.simulation.walkers import simulate_walks
from models.tracks.trajectory import Windows

Images = npt.NDArray[np.uint8]
_WIDTH = 96
_CHANNELS = (16, 32, 64, 64, 128)
_BATCH = 256
_LEARNING_RATE = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageSet:
    """Pictures (B, H, W) of walks, and what they were seen from: metres (B,), wxyz (B, 4)."""

    images: Tensor
    height_m: Tensor
    quaternion: Tensor


class TrajectoryPoseNet(nn.Module):
    """Raw height and quaternion (B, 5) of pictures (B, H, W) of 0 to 255."""

    def __init__(self, height: int, width: int = _WIDTH) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        for inputs, outputs in zip((1, *_CHANNELS), _CHANNELS, strict=False):
            layers += [nn.Conv2d(inputs, outputs, 3, stride=2, padding=1), nn.ReLU()]
            height, width = (height + 1) // 2, (width + 1) // 2
        self.convolutions = nn.Sequential(*layers, nn.Flatten())
        self.pose = nn.Sequential(
            nn.Linear(_CHANNELS[-1] * height * width, 256), nn.ReLU(), nn.Linear(256, 5)
        )

    def forward(self, images: Tensor) -> Tensor:
        """Height in metres first."""
        answer: Tensor = self.pose(self.convolutions(images[:, None].float() / 255))
        return answer


def draw_walks(uv: Array, intrinsics: Intrinsics) -> Images:
    """Pictures (B, H, 96) of walks (B, T, 2) in pixels, NaN after their ends."""
    scale = _WIDTH / intrinsics.width
    rows = max(1, round(intrinsics.height * scale))
    images = np.zeros((len(uv), rows, _WIDTH), np.uint8)
    # OpenCV takes whole numbers, here of sixteenths of a pixel; a pixel's middle is a whole one.
    points = np.round(((uv + 0.5) * scale - 0.5) * 16)
    for image, walk in zip(images, points, strict=True):
        line = walk[np.isfinite(walk[:, 0])].astype(np.int32)
        cv2.polylines(image, [line[:, None]], False, 255, shift=4)
    return images


def train_posenet(
    plan: TrainingPlan,
    *,
    alpha: float,
    epochs: int,
    on_share: Callable[[float], None] = lambda _: None,
) -> TrajectoryPoseNet:
    """A network trained on the poses, walks and loss of a plan of the paper's.

    Raises:
        DegenerateGeometryError: the camera sees no ground to walk on.
    """
    rng = np.random.default_rng(plan.seed)
    torch.manual_seed(plan.seed)
    poses = grid_poses(plan.prior_pose, plan.recipe.spread)
    repeats = np.repeat(np.arange(len(poses)), plan.recipe.walks_per_pose)
    data = _image_set(plan, poses.take(repeats), rng)
    network = TrajectoryPoseNet(data.images.shape[1])
    optimizer = torch.optim.Adam(network.parameters(), lr=_LEARNING_RATE)
    batches = math.ceil(len(data.images) / _BATCH)
    for epoch in range(epochs):
        for number, rows in enumerate(np.array_split(rng.permutation(len(data.images)), batches)):
            output = network(data.images[rows])
            loss = pose_loss(output, data.height_m[rows], data.quaternion[rows], alpha)
            optimizer.zero_grad()
            torch.autograd.backward(loss)
            optimizer.step()
            on_share((epoch + (number + 1) / batches) / epochs)
    network.eval()
    return network


def read_windows(
    network: TrajectoryPoseNet, windows: Windows, plan: TrainingPlan
) -> tuple[Array, Array]:
    """Heights (B,) in metres and unit quaternions wxyz (B, 4) of windows."""
    images = torch.from_numpy(draw_walks(windows.uv, plan.intrinsics))
    with torch.inference_mode():
        rows = torch.cat(
            [network(images[at : at + _BATCH]) for at in range(0, len(images), _BATCH)]
        )
    return pose_from_output(rows.double().numpy(), plan)


def parameters_of(network: nn.Module) -> int:
    """Number of a network's parameters."""
    return sum(weights.numel() for weights in network.parameters())


def _image_set(plan: TrainingPlan, poses: PoseSet, rng: np.random.Generator) -> ImageSet:
    walks = simulate_walks(plan.intrinsics, poses, plan.walk, rng)
    seen_by = poses.take(walks.pose_idx)
    quaternion = quaternion_from_rotation(seen_by.rotation)
    return ImageSet(
        images=torch.from_numpy(draw_walks(walks.uv, plan.intrinsics)),
        height_m=torch.from_numpy(seen_by.height_m.astype(np.float32)),
        quaternion=torch.from_numpy(quaternion.astype(np.float32)),
    )
