"""The network: trajectory in, height and orientation out; what it reads, its loss, its answers."""

import math

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn.utils.rnn import pack_padded_sequence

from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array, quaternion_from_rotation, rotation_from_angles
from models.regression.recipe import Inputs, Recipe, TrainingPlan
from models.tracks.trajectory import Windows

CHANNELS: dict[Inputs, int] = {"points": 2, "points_and_steps": 4, "levelled": 12}

_STEP_SCALE = 32.0
_LOWEST = 0.03  # of a unit ray, how far it falls: 33 camera heights away
_LONGEST_STEP = 4.0  # strides
_NEAREST = 0.05  # camera heights


def network_inputs(uv: Array, plan: TrainingPlan) -> Tensor:
    """Network input (B, T, C) of pixels (B, T, 2) by the recipe of a plan; NaN becomes 0."""
    if plan.recipe.inputs == "levelled":
        return _tensor(_levelled(uv, plan))
    return scale_points(uv, plan.intrinsics, plan.recipe.inputs)


def scale_points(uv: Array, intrinsics: Intrinsics, inputs: Inputs) -> Tensor:
    """Network input (B, T, 2) or (B, T, 4) of pixels (B, T, 2); NaN becomes 0.

    Points are scaled so that the image spans -1 to 1 on both axes. With
    `inputs="points_and_steps"` the step to each point stands beside it, 32 times as large: then
    both are of one size.
    """
    points = _scaled(uv, intrinsics)
    if inputs == "points_and_steps":
        points = np.concatenate([points, _STEP_SCALE * _steps(points)], axis=-1)
    return _tensor(points)


def _levelled(uv: Array, plan: TrainingPlan) -> Array:
    """Points, steps, and what they would be if the camera stood at its prior pose (B, T, 12).

    Rays as right, ahead and down there, how far off on the ground (log of camera heights), steps
    on the ground in strides of the plan's pace; and of the camera, how steeply it looks and what
    the range of heights is to its own.
    """
    prior, recipe, walk = plan.prior_pose, plan.recipe, plan.walk
    points = _scaled(uv, plan.intrinsics)
    rays, _ = plan.intrinsics.rays(uv)
    level = rays @ prior.level_from_camera.T
    level = level / np.linalg.norm(level, axis=-1, keepdims=True)
    down = np.maximum(-level[..., 2:], _LOWEST)
    ground = level[..., :2] / down
    stride = walk.speed_mean_mps * walk.step_s / prior.height_m
    of_camera = np.broadcast_to(
        [math.sin(prior.tilt_rad), math.log(recipe.spread.height_m / prior.height_m)],
        points.shape,
    )
    return np.concatenate(
        [
            points,
            _STEP_SCALE * _steps(points),
            level[..., :2],
            3 * down,
            np.log(np.linalg.norm(ground, axis=-1, keepdims=True) + _NEAREST),
            np.clip(_steps(ground) / stride, -_LONGEST_STEP, _LONGEST_STEP),
            np.where(np.isnan(points), np.nan, of_camera),
        ],
        axis=-1,
    )


def _scaled(uv: Array, intrinsics: Intrinsics) -> Array:
    half = np.array([intrinsics.width, intrinsics.height]) / 2
    return (uv + 0.5) / half - 1


def _steps(points: Array) -> Array:
    return np.diff(points, axis=1, prepend=points[:, :1])


def _tensor(channels: Array) -> Tensor:
    return torch.from_numpy(np.nan_to_num(channels, nan=0.0).astype(np.float32))


_PREDICTED_AT_ONCE = 2048  # windows


class PoseRegressor(nn.Module):
    """Bidirectional LSTM and an MLP with two branches, for height and for orientation.

    Source: Xu et al. 2020, section 3.3: two layers of 64 units, last states of both directions
    concatenated (128), MLP 128-256-1024-512, branches 512-256-128-1 and 512-256-128-4, ReLU after
    every layer but the last of a branch.
    """

    def __init__(self, channels: int = 2, orientation_outputs: int = 4) -> None:
        super().__init__()
        self.lstm = nn.LSTM(channels, 64, num_layers=2, bidirectional=True, batch_first=True)
        self.trunk = _perceptron(128, 256, 1024, 512)
        self.height = nn.Sequential(_perceptron(512, 256, 128), nn.Linear(128, 1))
        self.orientation = nn.Sequential(
            _perceptron(512, 256, 128), nn.Linear(128, orientation_outputs)
        )

    def forward(self, points: Tensor, lengths: Tensor) -> Tensor:
        """Raw outputs (B, 1 + orientation_outputs), height first, of scaled points (B, T, C).

        Only the first `lengths` (B,) points of each row are read.
        """
        longest = int(lengths.max())
        if bool((lengths == longest).all()):  # the dense kernel is twice as fast as the packed one
            _, (h_n, _) = self.lstm(points[:, :longest])
        else:
            packed = pack_padded_sequence(
                points, lengths.cpu(), batch_first=True, enforce_sorted=False
            )
            _, (h_n, _) = self.lstm(packed)  # (layers * directions, B, H)
        features = self.trunk(torch.cat([h_n[-2], h_n[-1]], dim=-1))
        return torch.cat([self.height(features), self.orientation(features)], dim=-1)


def network_for(recipe: Recipe) -> PoseRegressor:
    """A network with fresh weights and the inputs and outputs of a recipe."""
    return PoseRegressor(
        channels=CHANNELS[recipe.inputs],
        orientation_outputs=4 if recipe.target == "pose" else 2,
    )


def pose_loss(output: Tensor, height_m: Tensor, quaternion: Tensor, alpha: float) -> Tensor:
    """Mean of `|h* - h| + alpha * ||q* - q/||q|| ||` over a batch; q and -q count as one.

    `output` (B, 5) is raw, heights (B,) are in metres, quaternions (B, 4) of length 1, wxyz.

    Source: Xu et al. 2020, section 3.3.
    """
    q = nn.functional.normalize(output[:, 1:], dim=-1)
    sign = torch.where((q * quaternion).sum(-1, keepdim=True) < 0, -1.0, 1.0)
    orientation = torch.linalg.vector_norm(sign * quaternion - q, dim=-1)
    loss: Tensor = ((output[:, 0] - height_m).abs() + alpha * orientation).mean()
    return loss


def offsets_of(height_m: Array, tilt_rad: Array, roll_rad: Array, plan: TrainingPlan) -> Array:
    """Offsets (B, 3) of height, tilt and roll from the plan's prior, 1 at the range's end."""
    prior, spread = plan.prior_pose, plan.recipe.spread
    return np.stack(
        [
            (height_m - prior.height_m) / spread.height_m,
            (tilt_rad - prior.tilt_rad) / spread.angle_rad,
            (roll_rad - prior.roll_rad) / spread.angle_rad,
        ],
        axis=-1,
    )


def pose_from_output(output: Array, plan: TrainingPlan) -> tuple[Array, Array]:
    """Heights (B,) in metres and unit quaternions wxyz (B, 4), w >= 0, of raw outputs."""
    if plan.recipe.target == "offsets":
        prior, spread = plan.prior_pose, plan.recipe.spread
        height = prior.height_m + spread.height_m * output[:, 0]
        tilt = prior.tilt_rad + spread.angle_rad * output[:, 1]
        roll = prior.roll_rad + spread.angle_rad * output[:, 2]
        tilt = np.clip(tilt, -math.pi / 2, math.pi / 2)
        return height, quaternion_from_rotation(rotation_from_angles(tilt, roll, prior.heading_rad))
    q = output[:, 1:] / np.linalg.norm(output[:, 1:], axis=1, keepdims=True)
    return output[:, 0], np.where(q[:, :1] < 0, -q, q)


def predict_windows(
    network: PoseRegressor, windows: Windows, plan: TrainingPlan
) -> tuple[Array, Array]:
    """Heights (B,) in metres and unit quaternions wxyz (B, 4), w >= 0, of windows."""
    if not len(windows):
        return np.empty(0), np.empty((0, 4))
    points = network_inputs(windows.uv, plan)
    lengths = torch.from_numpy(windows.lengths)
    with torch.inference_mode():
        rows = torch.cat(
            [
                network(points[at : at + _PREDICTED_AT_ONCE], lengths[at : at + _PREDICTED_AT_ONCE])
                for at in range(0, len(windows), _PREDICTED_AT_ONCE)
            ]
        )
    return pose_from_output(rows.double().numpy(), plan)


def _perceptron(*widths: int) -> nn.Sequential:
    layers: list[nn.Module] = []
    for inputs, outputs in zip(widths, widths[1:], strict=False):
        layers += [nn.Linear(inputs, outputs), nn.ReLU()]
    return nn.Sequential(*layers)
