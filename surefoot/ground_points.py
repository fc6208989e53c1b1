"""Pixels to places on the ground and back, and how far off they are by the error of a pose."""

import math
from collections.abc import Sequence

import numpy as np

from models.geometry.ground import ground_from_pixel, ground_of_rays, pixel_from_ground
from models.geometry.propagation import error_ellipses
from models.geometry.rotation import Array
from surefoot.camera import Camera, Pose
from surefoot.result import Result, served_covariance


def ground(
    camera: Camera, points: Sequence[Sequence[float]], pose: Pose | None = None
) -> list[tuple[float, float] | None]:
    """Places (x, y) on the ground of pixels (u, v), in metres; None above the horizon.

    Args:
        camera: whose lens, and whose prior pose unless another is given.
        points: pixels of feet, u right and v down.
        pose: where the camera stands by now, such as a result's.
    """
    stands = (pose or camera.prior_pose).in_radians
    pixels = np.asarray(points, dtype=np.float64).reshape(-1, 2)
    places, valid = ground_from_pixel(camera.intrinsics, stands.rotation, stands.centre_m, pixels)
    return [
        (float(x), float(y)) if seen else None for (x, y), seen in zip(places, valid, strict=True)
    ]


def image(
    camera: Camera, places: Sequence[Sequence[float]], pose: Pose | None = None
) -> list[tuple[float, float] | None]:
    """Pixels (u, v) of places (x, y) on the ground in metres; None behind the camera.

    Pixels may lie outside the picture.

    Args:
        camera: whose lens, and whose prior pose unless another is given.
        places: x and y in the world, metres.
        pose: where the camera stands by now, such as a result's.
    """
    stands = (pose or camera.prior_pose).in_radians
    metres = np.asarray(places, dtype=np.float64).reshape(-1, 2)
    pixels, valid = pixel_from_ground(camera.intrinsics, stands.rotation, stands.centre_m, metres)
    return [
        (float(u), float(v)) if seen else None for (u, v), seen in zip(pixels, valid, strict=True)
    ]


def ellipses(
    camera: Camera, points: Sequence[Sequence[float]], result: Result
) -> list[tuple[float, float, float] | None]:
    """One-sd ellipses of the places of pixels (u, v) by a result's pose; None above the horizon.

    Each is its semi-axes in metres, the major first, and the major's direction in degrees clockwise
    from +Y. 95 of 100 true places are within 2.45 of them. They include numbers that the tracks do
    not determine, such as a heading without paths.
    """
    rays, _ = camera.intrinsics.rays(np.asarray(points, dtype=np.float64).reshape(-1, 2))

    def placed(rotation: Array, height_m: float) -> Array:
        return height_m * ground_of_rays(rays, rotation)[0]

    found = error_ellipses(placed, result.pose.in_radians, served_covariance(result))
    return [
        (major, minor, (90.0 - math.degrees(angle)) % 180.0) if math.isfinite(major) else None
        for major, minor, angle in found.tolist()
    ]
