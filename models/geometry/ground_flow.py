"""Velocities of the ground points of fixed rays when the camera turns.

Points are in camera heights, relative to the camera's foot point, axes as the world's.
"""

from typing import NamedTuple

import numpy as np

from models.compiled import compiled
from models.geometry.rotation import Array, rotation_and_derivatives


class GroundFlow(NamedTuple):
    """Velocity of one ground point, `x` and `y`, and the share `fall` that its ray falls."""

    x: float
    y: float
    fall: float


def rotation_and_turns(tilt_rad: float, roll_rad: float, heading_rad: float) -> tuple[Array, Array]:
    """The rotation (3, 3), and turns T (2, 3, 3) of tilt and roll: a direction w moves by w T."""
    rotation, derivatives = rotation_and_derivatives(tilt_rad, roll_rad, heading_rad)
    return rotation, np.array([rotation.T @ turned for turned in derivatives])


@compiled
def ground_flow(x: float, y: float, turn: Array) -> GroundFlow:
    """Velocity of a ground point under a turn (3, 3).

    It is g = w_xy / -w_z of its ray's direction w; w changes by w T, and w_z by that share of
    itself, with the sign turned.
    """
    fall = x * turn[0, 2] + y * turn[1, 2] - turn[2, 2]
    return GroundFlow(
        x * turn[0, 0] + y * turn[1, 0] - turn[2, 0] + x * fall,
        x * turn[0, 1] + y * turn[1, 1] - turn[2, 1] + y * fall,
        fall,
    )
