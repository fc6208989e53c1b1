"""Between pixels and the ground plane Z = 0, for one camera pose or many at once."""

import numpy as np

from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array, Mask

_HORIZON_SINE = 1e-3  # a ray less than 0.06 deg below the horizon hits no ground we trust


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

    A pixel at or above the horizon, or that no ray reaches, is NaN and not valid. Shapes as in
    `pixel_from_ground`, whose inverse this is.
    """
    rays, valid = intrinsics.rays(uv)
    return ground_from_ray(rotation, centre_m, rays, valid)


def ground_from_ray(
    rotation: Array, centre_m: Array, rays: Array, valid: Mask
) -> tuple[Array, Mask]:
    """`ground_from_pixel` for rays (..., N, 3) of the camera frame that are already undistorted."""
    world = rays @ rotation  # rows are points: (R.T @ ray).T
    down = -world[..., 2] / np.linalg.norm(world, axis=-1)
    hits = valid & (down > _HORIZON_SINE)
    scale = centre_m[..., None, 2] / np.where(hits, -world[..., 2], 1.0)
    ground = centre_m[..., None, :2] + scale[..., None] * world[..., :2]
    return np.where(hits[..., None], ground, np.nan), hits
