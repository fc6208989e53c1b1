"""What a regressor says of windows of trajectories."""

import numpy as np
import torch

from models.geometry.rotation import Array
from models.regression.inputs import network_inputs
from models.regression.network import PoseRegressor, pose_from_output
from models.regression.recipe import TrainingPlan
from models.tracks.trajectory import Windows

_BATCH = 2048


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
                network(points[at : at + _BATCH], lengths[at : at + _BATCH])
                for at in range(0, len(windows), _BATCH)
            ]
        )
    return pose_from_output(rows.double().numpy(), plan)
