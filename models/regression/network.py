"""The network: trajectory in, height and orientation out; its loss, and its predictions."""

import math

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn.utils.rnn import pack_padded_sequence

from models.geometry.rotation import Array, quaternion_from_rotation, rotation_from_angles
from models.regression.inputs import CHANNELS, network_inputs
from models.regression.recipe import Recipe, TrainingPlan
from models.tracks.trajectory import Windows

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

    Args:
        output: raw network output (B, 5), height in metres.
        height_m: true heights (B,).
        quaternion: true unit quaternions wxyz (B, 4).
        alpha: weight of the orientation.

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
