"""How the ground points of fixed rays move when the camera turns.

Points are in camera heights, relative to the camera's foot point, axes as the world's.
"""

import numpy as np

from models.geometry.rotation import Array, rotation_and_derivatives


def rotation_and_turns(
    tilt_rad: float, roll_rad: float, heading_rad: float
) -> tuple[Array, list[Array]]:
    """The rotation (3, 3), and for tilt and roll a T (3, 3): a ray's direction w moves by w T."""
    rotation, derivatives = rotation_and_derivatives(tilt_rad, roll_rad, heading_rad)
    return rotation, [rotation.T @ turned for turned in derivatives]


def ground_flow(ground: Array, turn: Array) -> tuple[Array, Array]:
    """How ground points (M, 2) move under a turn (M, 2), and the share (M,) that their ray falls.

    A ray's ground point is g = w_xy / -w_z; w changes by w T, and w_z by that share of itself, with
    the sign turned.
    """
    moved = down_to(ground) @ turn
    return moved[:, :2] + ground * moved[:, 2:], moved[:, 2]


def down_to(ground: Array) -> Array:
    """World directions (M, 3) to ground points (M, 2), one camera height down."""
    return np.concatenate([ground, -np.ones((len(ground), 1))], axis=1)
