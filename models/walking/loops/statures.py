"""How tall people are at one pose, from feet to the tops of their boxes, and how that changes.

Places here are in camera heights from the camera's foot, axes as the world's.
"""

import math

import numpy as np

from models.compiled import compiled
from models.geometry.ground_flow import ground_flow
from models.geometry.landing import landing
from models.geometry.rotation import Array, Mask


@compiled
def heights_of_tops(
    foot_rays: Array,
    top_y: Array,
    rotation: Array,
    turns: Array,
    height_m: float,
    least_ratio: float,
) -> tuple[Array, Array, Mask, Array, Array]:
    """Log heights of people (M,), where they stand (M, 2) in metres, and which are on the ground.

    A height is that of `geometry.upright.stature_ratio`: n / m camera heights, with
    m = down_z - y forward_z and n = (y forward - down) . (p, -1).

    Args:
        foot_rays: of the feet (M, 3), z = 1, in the camera frame.
        top_y: undistorted, normalised y (M,) of the upper edges.
        rotation: `camera_from_world` (3, 3).
        turns: how a ray's direction in the world moves (T, 3, 3): for tilt and roll, or for none.
        height_m: of the camera.
        least_ratio: of a person's height to the camera's.

    Returns:
        The three, and derivatives of the first two (M, 3) and (M, 2, 3) by tilt, roll, log height;
        where there are no turns, by log height alone.
    """
    count = top_y.size
    value, valid = np.zeros(count), np.zeros(count, dtype=np.bool_)
    place, d_value, d_place = np.zeros((count, 2)), np.zeros((count, 3)), np.zeros((count, 2, 3))
    for j in range(count):
        y = top_y[j]
        east, north, on_ground = landing(foot_rays, j, rotation)
        lean_x = y * rotation[2, 0] - rotation[1, 0]
        lean_y = y * rotation[2, 1] - rotation[1, 1]
        lean_z = y * rotation[2, 2] - rotation[1, 2]
        ratio = 1.0
        if on_ground:
            seen = (lean_x * east + lean_y * north - lean_z) / -lean_z
            if seen > least_ratio:
                ratio, valid[j] = seen, True
                value[j] = math.log(ratio * height_m)
        place[j, 0], place[j, 1] = east * height_m, north * height_m
        for number in range(len(turns)):
            turn = turns[number]
            flow = ground_flow(east, north, turn)
            d_place[j, 0, number], d_place[j, 1, number] = flow.x * height_m, flow.y * height_m
            if valid[j]:
                bent_x = lean_x * turn[0, 0] + lean_y * turn[1, 0] + lean_z * turn[2, 0]
                bent_y = lean_x * turn[0, 1] + lean_y * turn[1, 1] + lean_z * turn[2, 1]
                bent_z = lean_x * turn[0, 2] + lean_y * turn[1, 2] + lean_z * turn[2, 2]
                top = bent_x * east + bent_y * north - bent_z + lean_x * flow.x + lean_y * flow.y
                d_value[j, number] = (top + ratio * bent_z) / -lean_z / ratio
        d_place[j, 0, 2], d_place[j, 1, 2] = place[j]
        d_value[j, 2] = 1.0 if valid[j] else 0.0
    return value, place, valid, d_value, d_place
