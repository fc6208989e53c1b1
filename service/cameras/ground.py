"""Pixels to places on the ground and back, by the pose that held, with an error ellipse each.

An ellipse is of the pose alone: a foot that was seen some pixels off is beside it.
"""

import numpy as np

from models.geometry.ground import ground_of_rays, pixel_from_ground
from models.geometry.intrinsics import Intrinsics
from models.geometry.propagation import error_ellipses
from models.geometry.rotation import Array
from service.cameras.held_poses import HeldPose
from service.errors import ConflictError


def places_of_pixels(
    intrinsics: Intrinsics, held: HeldPose, uv: Array
) -> tuple[Array, Array | None]:
    """Places (N, 2) in metres of pixels (N, 2), NaN above the horizon, and their ellipses (N, 3).

    An ellipse is its semi-axes in metres and the direction of the major one, in radians clockwise
    from +Y, like a heading. None where nothing says how sure the pose is.

    Raises:
        ConflictError: no prior pose has been confirmed.
    """
    _require_known(held)
    rays, _ = intrinsics.rays(uv)
    foot_m = held.pose.centre_m[:2]

    def placed(rotation: Array, height_m: float) -> Array:
        return foot_m + height_m * ground_of_rays(rays, rotation)[0]

    places = placed(held.pose.rotation, held.pose.height_m)
    if held.covariance is None:
        return places, None
    ellipses = error_ellipses(placed, held.pose, held.covariance)
    ellipses[:, 2] = np.mod(np.pi / 2 - ellipses[:, 2], np.pi)
    return places, ellipses


def pixels_of_places(
    intrinsics: Intrinsics, held: HeldPose, ground_m: Array
) -> tuple[Array, Array | None]:
    """Pixels (N, 2) of places (N, 2), NaN behind the camera, and their ellipses (N, 3).

    An ellipse is its semi-axes in pixels and the angle of the major one, in radians clockwise from
    +u as the picture is seen.

    Raises:
        ConflictError: as of places.
    """
    _require_known(held)

    def placed(rotation: Array, height_m: float) -> Array:
        centre_m = np.array([held.pose.x_m, held.pose.y_m, height_m])
        return pixel_from_ground(intrinsics, rotation, centre_m, ground_m)[0]

    pixels = placed(held.pose.rotation, held.pose.height_m)
    if held.covariance is None:
        return pixels, None
    ellipses = error_ellipses(placed, held.pose, held.covariance)
    ellipses[:, 2] = np.mod(ellipses[:, 2], np.pi)
    return pixels, ellipses


def _require_known(held: HeldPose) -> None:
    if held.assumed:
        raise ConflictError("pose: no prior pose has been confirmed yet")
