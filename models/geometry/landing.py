"""Ground point of one ray: `ground_of_rays` for loops that are compiled.

Places are in camera heights, from the camera's foot point; axes are the world's.
"""

import math
from typing import NamedTuple

from models.compiled import compiled
from models.geometry.ground import LOWEST_SINE
from models.geometry.rotation import Array


class Landing(NamedTuple):
    """Ground point of a ray, `x` and `y`; both are 0 where it is not `valid`."""

    x: float
    y: float
    valid: bool


@compiled
def landing(rays: Array, number: int, rotation: Array) -> Landing:
    """Ground point of one of camera-frame rays (M, 3); `rotation` (3, 3) `camera_from_world`."""
    ray_x, ray_y, ray_z = rays[number, 0], rays[number, 1], rays[number, 2]
    x = ray_x * rotation[0, 0] + ray_y * rotation[1, 0] + ray_z * rotation[2, 0]
    y = ray_x * rotation[0, 1] + ray_y * rotation[1, 1] + ray_z * rotation[2, 1]
    down = -(ray_x * rotation[0, 2] + ray_y * rotation[1, 2] + ray_z * rotation[2, 2])
    if down > LOWEST_SINE * math.sqrt(x * x + y * y + down * down):
        heights = 1 / down
        return Landing(x * heights, y * heights, True)
    return Landing(0.0, 0.0, False)
