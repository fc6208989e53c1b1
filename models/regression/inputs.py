"""Inputs of a network, of a walk."""

import math

import numpy as np
import torch
from torch import Tensor

from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array
from models.regression.recipe import Inputs, TrainingPlan

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
