"""The horizon in the picture, and how much of the picture is ground."""

import numpy as np

from models.geometry.ground import ground_from_pixel
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array, Mask

_POINTS = 721  # every half degree around


def horizon_pixels(
    intrinsics: Intrinsics, pose: CameraPose, points: int = _POINTS
) -> tuple[Array, Mask]:
    """Pixels (N, 2) of the level directions all around, and which are valid (N,).

    They begin and end behind the camera and run clockwise as seen from above: from left to right
    in the picture of an upright camera. Valid ones may lie outside the picture, others are NaN.

    A level camera without distortion has its horizon on the line v = cy - fy tan(tilt): above
    the middle where it looks down.
    """
    azimuth = pose.heading_rad + np.linspace(-np.pi, np.pi, points)
    level = np.stack([np.sin(azimuth), np.cos(azimuth), np.zeros(points)], axis=-1)
    return intrinsics.project(level @ pose.rotation.T)


def ground_share(intrinsics: Intrinsics, pose: CameraPose, across: int = 33) -> float:
    """Share of the picture that shows ground rather than sky, of a lattice of its pixels."""
    _, hits = ground_from_pixel(
        intrinsics, pose.rotation, pose.centre_m, picture_lattice(intrinsics, across)
    )
    return float(hits.mean())


def picture_lattice(intrinsics: Intrinsics, across: int) -> Array:
    """Pixels (across^2, 2) evenly over the picture, its corners among them."""
    u = np.linspace(-0.5, intrinsics.width - 0.5, across)
    v = np.linspace(-0.5, intrinsics.height - 0.5, across)
    return np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
