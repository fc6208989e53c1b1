"""The outline of the ground that a camera sees."""

import numpy as np

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array

REACH = 10.0  # camera heights, where no track says how far people are seen
_BORDER = 25  # pixels of each side of the picture's edge


def view_outline(lens: Intrinsics, pose: CameraPose, reach_m: float) -> Array:
    """The outline (N, 2) of the ground that a camera sees, cut at a distance from its foot.

    Where the edge of the picture is above the horizon, the ground ends at that distance.
    """
    edge = lens.pulled_in(_picture_edge(lens))
    rays, on_ray = lens.rays(edge)
    world = rays[on_ray] @ pose.rotation
    level = np.linalg.norm(world[:, :2], axis=1)
    down = -world[:, 2]
    far = down * reach_m <= level * pose.height_m  # not downwards counts as far, too
    scale = np.where(
        far, reach_m / np.maximum(level, 1e-12), pose.height_m / np.where(far, 1, down)
    )
    return np.asarray(pose.centre_m[:2] + world[:, :2] * scale[:, None])


def _picture_edge(lens: Intrinsics) -> Array:
    across = np.linspace(-0.5, lens.width - 0.5, _BORDER)
    along = np.linspace(-0.5, lens.height - 0.5, _BORDER)
    left, right = np.full(_BORDER, across[0]), np.full(_BORDER, across[-1])
    top, bottom = np.full(_BORDER, along[0]), np.full(_BORDER, along[-1])
    sides = [(across, top), (right, along), (across[::-1], bottom), (left, along[::-1])]
    return np.concatenate([np.stack(side, axis=-1) for side in sides])
