"""Between pixels and the ground plane Z = 0, for one camera pose or many at once."""

import numpy as np

from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array, Mask
from models.geometry.vectors import norm

# Of the angle below the horizon: 0.3 deg, 200 camera heights away. A pixel of a street camera is
# 0.05 deg, so that one of noise there moves a place by a fifth of its distance; nearer to the
# horizon a place is noise, and its derivatives, which estimators follow, are more so.
LOWEST_SINE = 5e-3


def pixel_from_ground(
    intrinsics: Intrinsics, rotation: Array, centre_m: Array, ground_m: Array
) -> tuple[Array, Mask]:
    """Pixels (..., N, 2) of ground points (..., N, 2), and which are valid (..., N).

    Args:
        intrinsics: the lens.
        rotation: `camera_from_world` (..., 3, 3).
        centre_m: camera centres in the world (..., 3).
        ground_m: x and y in the world (..., N, 2), metres.

    Points behind the camera or folded back by the distortion are NaN and not valid; valid points
    may lie outside the image.
    """
    from_centre = np.concatenate(
        [
            ground_m - centre_m[..., None, :2],
            np.broadcast_to(-centre_m[..., None, 2:], (*ground_m.shape[:-1], 1)),
        ],
        axis=-1,
    )
    return intrinsics.project(from_centre @ np.swapaxes(rotation, -1, -2))


def ground_from_pixel(
    intrinsics: Intrinsics, rotation: Array, centre_m: Array, uv: Array
) -> tuple[Array, Mask]:
    """Ground points x, y (..., N, 2) in metres of pixels (..., N, 2), and which are valid.

    A pixel that is not clearly below the horizon, or that no ray reaches, is NaN and not valid.
    Shapes as in `pixel_from_ground`, whose inverse this is.
    """
    rays, known = intrinsics.rays(uv)
    world, down, below = _falling(rays, rotation)
    hits = known & below
    scale = centre_m[..., None, 2] / down
    ground = centre_m[..., None, :2] + scale[..., None] * world[..., :2]
    return np.where(hits[..., None], ground, np.nan), hits


def ground_of_rays(rays: Array, rotation: Array, beyond: float = np.nan) -> tuple[Array, Mask]:
    """Ground points (..., N, 2) of rays (..., N, 3) of the camera frame, and which are valid.

    In camera heights from the camera's foot, axes as the world's. What is not valid is `beyond`,
    which is 0 for those whose sums over all rays have to stay finite.
    """
    world, down, valid = _falling(rays, rotation)
    return np.where(valid[..., None], world[..., :2] / down[..., None], beyond), valid


def _falling(rays: Array, rotation: Array) -> tuple[Array, Array, Mask]:
    """World directions (..., N, 3) of rays, how far they fall (..., N), and which hit the ground.

    A ray less than 0.3 deg below the horizon hits none that is worth anything; 1 stands for how
    far it falls.
    """
    world = rays @ rotation  # rows are points: (R.T @ ray).T
    down = -world[..., 2]
    valid = down > LOWEST_SINE * norm(world)
    return world, np.where(valid, down, 1.0), valid
