"""The field of view: which part of each block of ground is in a camera's picture.

Each side of the picture is as far from a block, in block sizes, as a linear function of its place
says: the depth by which a pixel is divided is also what a block's size in pixels is divided by.
"""

from typing import NamedTuple

import numpy as np

from models.compiled import compiled
from models.geometry.rotation import Array
from models.paths.density_grid import Grid, unseen_at

_NEAREST_M = 0.1


class Lens(NamedTuple):
    """The intrinsics, in pixels, without distortion."""

    fx: float
    fy: float
    cx: float
    cy: float
    width: float
    height: float


class Cameras(NamedTuple):
    """K cameras by `camera_from_world`, `rotations` (K, 3, 3), and heights (K,)."""

    rotations: Array
    heights_m: Array


class Blocks(NamedTuple):
    """B squares of ground around places (B,), in metres from the cameras' foot point."""

    x_m: Array
    y_m: Array
    size_m: float


class Side(NamedTuple):
    """A linear function of a place: `by_x` x + `by_y` y + `at_foot`."""

    by_x: float
    by_y: float
    at_foot: float


class Frame(NamedTuple):
    """A place's `depth` (m), and how far inside of each side its block reaches, of its size."""

    depth: Side
    left: Side
    right: Side
    upper: Side
    lower: Side


@compiled
def frame_of(lens: Lens, rotation: Array, height_m: float, size_m: float) -> Frame:
    """The picture of a camera with `camera_from_world` (3, 3), for blocks of a size."""
    right = Side(rotation[0, 0], rotation[0, 1], -height_m * rotation[0, 2])
    down = Side(rotation[1, 0], rotation[1, 1], -height_m * rotation[1, 2])
    depth = Side(rotation[2, 0], rotation[2, 1], -height_m * rotation[2, 2])
    unit = lens.fx * size_m
    u = _sum_of(right, lens.fx / unit, depth, lens.cx / unit, 0.5)
    v = _sum_of(down, lens.fy / unit, depth, lens.cy / unit, 0.5)
    return Frame(
        depth,
        u,
        _sum_of(u, -1.0, depth, lens.width / unit, 1.0),
        v,
        _sum_of(v, -1.0, depth, lens.height / unit, 1.0),
    )


@compiled
def part_in_frame(frame: Frame, x_m: float, y_m: float) -> float:
    """The part, 0 to 1, of the block at a place that is in the picture.

    A block crosses a side bit by bit, so that the part has slopes and no steps.
    """
    across = _within(frame.left, x_m, y_m) * _within(frame.right, x_m, y_m)
    along = _within(frame.upper, x_m, y_m) * _within(frame.lower, x_m, y_m)
    return across * along if _at(frame.depth, x_m, y_m) > _NEAREST_M else 0.0


@compiled
def _sum_of(first: Side, share: float, second: Side, other: float, more: float) -> Side:
    """Shares of two functions, and more."""
    return Side(
        share * first.by_x + other * second.by_x,
        share * first.by_y + other * second.by_y,
        share * first.at_foot + other * second.at_foot + more,
    )


@compiled
def _at(side: Side, x_m: float, y_m: float) -> float:
    return side.by_x * x_m + side.by_y * y_m + side.at_foot


@compiled
def _within(side: Side, x_m: float, y_m: float) -> float:
    return min(max(_at(side, x_m, y_m), 0.0), 1.0)


@compiled
def fill(parts: Array, frame: Frame, blocks: Blocks) -> None:
    """Write the part of each block that is in a frame into (B,)."""
    for block in range(blocks.x_m.size):
        parts[block] = part_in_frame(frame, blocks.x_m[block], blocks.y_m[block])


@compiled
def product(parts: Array, shares: Array) -> float:
    """The sum of parts (B,) times shares (B,)."""
    total = 0.0
    for block in range(parts.size):
        total += parts[block] * shares[block]
    return total


@compiled
def parts_in_view(lens: Lens, cameras: Cameras, blocks: Blocks) -> Array:
    """The part (K, B) of each block that each camera sees."""
    parts = np.empty((len(cameras.rotations), blocks.x_m.size))
    for camera in range(len(parts)):
        rotation, height_m = cameras.rotations[camera], cameras.heights_m[camera]
        fill(parts[camera], frame_of(lens, rotation, height_m, blocks.size_m), blocks)
    return parts


@compiled
def sums_in_view(
    lens: Lens, cameras: Cameras, blocks: Blocks, shares: Array, unseen: Array
) -> tuple[Array, Array]:
    """The sums of shares (S, B) and of unseen ones (B,) in view: (K, S) and (K,)."""
    count = len(cameras.rotations)
    seen, beyond = np.empty((count, len(shares))), np.empty(count)
    parts = np.empty(blocks.x_m.size)
    for camera in range(count):
        rotation, height_m = cameras.rotations[camera], cameras.heights_m[camera]
        fill(parts, frame_of(lens, rotation, height_m, blocks.size_m), blocks)
        beyond[camera] = product(parts, unseen)
        for slot in range(len(shares)):
            seen[camera, slot] = product(parts, shares[slot])
    return seen, beyond


@compiled
def seen_sums_in_view(
    lens: Lens,
    cameras: Cameras,
    blocks: Blocks,
    shares: Array,
    grid: Grid,
    anchor: Array,
    anchor_height_m: float,
) -> Array:
    """The sums of shares (S, B) in view (K, S), where an anchor sees ground the reference saw.

    Whatever part of the picture a block is in: from the anchor (3, 3) that part sees other ground,
    or the sky, which counts as its foot point.
    """
    count = len(cameras.rotations)
    sums, parts = np.empty((count, len(shares))), np.empty(blocks.x_m.size)
    there = np.empty((3, 3))  # the anchor's world axes by a block's (x, y, 1)
    for camera in range(count):
        rotation, height_m = cameras.rotations[camera], cameras.heights_m[camera]
        for axis in range(3):
            for column in range(3):
                there[axis, column] = 0.0
                for row in range(3):
                    there[axis, column] += anchor[row, axis] * rotation[row, column]
            there[axis, 2] *= -height_m
        fill(parts, frame_of(lens, rotation, height_m, blocks.size_m), blocks)
        for block in range(parts.size):
            if parts[block] > 0:
                x, y = blocks.x_m[block], blocks.y_m[block]
                down = -(there[2, 0] * x + there[2, 1] * y + there[2, 2])
                scale = anchor_height_m / down if down > _NEAREST_M else 0.0
                x_there = (there[0, 0] * x + there[0, 1] * y + there[0, 2]) * scale
                y_there = (there[1, 0] * x + there[1, 1] * y + there[1, 2]) * scale
                parts[block] *= 1 - unseen_at(grid, x_there, y_there).value
        for slot in range(len(shares)):
            sums[camera, slot] = product(parts, shares[slot])
    return sums
