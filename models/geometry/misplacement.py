"""Errors on the ground of a pose that is not true: where it places people."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.errors import ShapeError
from models.geometry.ground import ground_from_pixel, pixel_from_ground
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose


@dataclass(frozen=True, slots=True, kw_only=True)
class Misplacement:
    """Error in the place of a person who stands at a distance from the camera's foot.

    `off_m` and `placed_m` are None where the wrong pose takes the person to be above its horizon,
    which is nowhere. `farther_m` is how much of it is along the line of sight, positive away from
    the camera. Places are x and y in the world.
    """

    distance_m: float
    off_m: float | None
    farther_m: float | None
    stands_m: tuple[float, float]
    placed_m: tuple[float, float] | None


def misplacements(
    intrinsics: Intrinsics, true: CameraPose, believed: CameraPose, distances_m: Sequence[float]
) -> tuple[Misplacement, ...]:
    """Errors in the places of people straight ahead, of a believed pose while another one is true.

    A person stands at each distance from the point below the camera, in the direction that the
    true optical axis has on the ground. What the true camera sees there is put back on the ground
    by the believed one. Distances that are not in the picture are left out.

    Pin: a camera 10 m high that looks down by 45 deg sees a person at 10 m in its middle; one that
    is believed to look down by 40 deg puts that middle at 10 / tan 40 deg = 11.92 m.

    Raises:
        ShapeError: a distance is not above 0.
    """
    if any(not distance > 0 for distance in distances_m):
        raise ShapeError(f"distances_m: must be above 0, got {list(distances_m)}")
    away = np.array([math.sin(true.heading_rad), math.cos(true.heading_rad)])
    stands = true.centre_m[:2] + np.outer(np.asarray(distances_m, dtype=np.float64), away)
    uv, _ = pixel_from_ground(intrinsics, true.rotation, true.centre_m, stands)
    placed, hit = ground_from_pixel(intrinsics, believed.rotation, believed.centre_m, uv)
    off = placed - stands
    return tuple(
        Misplacement(
            distance_m=float(distance),
            off_m=float(np.linalg.norm(step)) if lands else None,
            farther_m=float(step @ away) if lands else None,
            stands_m=(float(stand[0]), float(stand[1])),
            placed_m=(float(stand[0] + step[0]), float(stand[1] + step[1])) if lands else None,
        )
        for distance, stand, step, lands, seen in zip(
            distances_m, stands, off, hit, intrinsics.contains(uv), strict=True
        )
        if seen
    )
