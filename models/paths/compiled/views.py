"""How much of the ground cameras see: loops over cameras and blocks.

K cameras, each by `camera_from_world` (K, 3, 3) and height (K,) in metres; B blocks by their places
x, y (B,) in metres from the foot point; S parts of the day.
"""

import numpy as np

from models.compiled import compiled
from models.geometry.rotation import Array
from models.paths.compiled.block import NEAREST_M, Frame, Lens, frame_of, part_in_frame
from models.paths.compiled.place import Grid, unseen_at


@compiled
def fill(parts: Array, frame: Frame, x_m: Array, y_m: Array) -> None:
    """Write which part of each block is in a frame into (B,)."""
    for block in range(x_m.size):
        parts[block] = part_in_frame(frame, x_m[block], y_m[block])


@compiled
def product(parts: Array, shares: Array) -> float:
    """The sum of parts (B,) times shares (B,)."""
    total = 0.0
    for block in range(parts.size):
        total += parts[block] * shares[block]
    return total


@compiled
def parts_in_view(
    lens: Lens, rotations: Array, heights_m: Array, x_m: Array, y_m: Array, size_m: float
) -> Array:
    """Which part (K, B) of each block each camera sees."""
    parts = np.empty((len(rotations), x_m.size))
    for camera in range(len(rotations)):
        frame = frame_of(lens, rotations[camera], heights_m[camera], size_m)
        fill(parts[camera], frame, x_m, y_m)
    return parts


@compiled
def sums_in_view(
    lens: Lens,
    rotations: Array,
    heights_m: Array,
    x_m: Array,
    y_m: Array,
    size_m: float,
    shares: Array,
    unknown: Array,
) -> tuple[Array, Array]:
    """What there is of shares (S, B) and of the unknown (B,) in view: (K, S) and (K,)."""
    known, beyond = np.empty((len(rotations), len(shares))), np.empty(len(rotations))
    parts = np.empty(x_m.size)
    for camera in range(len(rotations)):
        frame = frame_of(lens, rotations[camera], heights_m[camera], size_m)
        fill(parts, frame, x_m, y_m)
        beyond[camera] = product(parts, unknown)
        for slot in range(len(shares)):
            known[camera, slot] = product(parts, shares[slot])
    return known, beyond


@compiled
def known_sums_in_view(
    lens: Lens,
    rotations: Array,
    heights_m: Array,
    x_m: Array,
    y_m: Array,
    size_m: float,
    shares: Array,
    grid: Grid,
    anchor: Array,
    anchor_height_m: float,
) -> Array:
    """What there is of shares (S, B) in view (K, S), where an anchor sees known ground.

    Whatever part of the picture a block is in: from the anchor (3, 3) that part sees other ground,
    or the sky, which counts as its foot point.
    """
    sums, parts = np.empty((len(rotations), len(shares))), np.empty(x_m.size)
    there = np.empty((3, 3))  # the anchor's world axes by a block's (x, y, 1)
    for camera in range(len(rotations)):
        rotation, height_m = rotations[camera], heights_m[camera]
        frame = frame_of(lens, rotation, height_m, size_m)
        for axis in range(3):
            for column in range(3):
                there[axis, column] = 0.0
                for row in range(3):
                    there[axis, column] += anchor[row, axis] * rotation[row, column]
            there[axis, 2] *= -height_m
        fill(parts, frame, x_m, y_m)
        for block in range(x_m.size):
            if parts[block] > 0:
                x, y = x_m[block], y_m[block]
                down = -(there[2, 0] * x + there[2, 1] * y + there[2, 2])
                scale = anchor_height_m / down if down > NEAREST_M else 0.0
                x_there = (there[0, 0] * x + there[0, 1] * y + there[0, 2]) * scale
                y_there = (there[1, 0] * x + there[1, 1] * y + there[1, 2]) * scale
                parts[block] *= 1 - unseen_at(grid, x_there, y_there).value
        for slot in range(len(shares)):
            sums[camera, slot] = product(parts, shares[slot])
    return sums
