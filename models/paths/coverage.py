"""The coverage of a map by a camera: people who are not in the picture give no track.

Ours: share = sum over blocks of the map's people times the part of the block in the picture.

Each side of the picture is as far from a block, in block sizes, as a linear function of its place
says: the depth by which a pixel is divided is also what a block's size in pixels is divided by.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from models.compiled import compiled
from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array, rotation_from_angles
from models.paths import config
from models.paths.density_map import Grid, PathDensityMap, unseen_at

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
def _frame_of(lens: Lens, rotation: Array, height_m: float, size_m: float) -> Frame:
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
def _part_in_frame(frame: Frame, x_m: float, y_m: float) -> float:
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
def _fill(parts: Array, frame: Frame, blocks: Blocks) -> None:
    """Write the part of each block that is in a frame into (B,)."""
    for block in range(blocks.x_m.size):
        parts[block] = _part_in_frame(frame, blocks.x_m[block], blocks.y_m[block])


@compiled
def _product(parts: Array, shares: Array) -> float:
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
        _fill(parts[camera], _frame_of(lens, rotation, height_m, blocks.size_m), blocks)
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
        _fill(parts, _frame_of(lens, rotation, height_m, blocks.size_m), blocks)
        beyond[camera] = _product(parts, unseen)
        for slot in range(len(shares)):
            seen[camera, slot] = _product(parts, shares[slot])
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
        _fill(parts, _frame_of(lens, rotation, height_m, blocks.size_m), blocks)
        for block in range(parts.size):
            if parts[block] > 0:
                x, y = blocks.x_m[block], blocks.y_m[block]
                down = -(there[2, 0] * x + there[2, 1] * y + there[2, 2])
                scale = anchor_height_m / down if down > _NEAREST_M else 0.0
                x_there = (there[0, 0] * x + there[0, 1] * y + there[0, 2]) * scale
                y_there = (there[1, 0] * x + there[1, 1] * y + there[1, 2]) * scale
                parts[block] *= 1 - unseen_at(grid, x_there, y_there).value
        for slot in range(len(shares)):
            sums[camera, slot] = _product(parts, shares[slot])
    return sums


@dataclass(frozen=True, slots=True, kw_only=True)
class Coverage:
    """The map in blocks of ground: places (B, 2), with how many people walk there.

    `shares` (S, B) are those of the seen ground in each part of the day, `unseen` (B,) those that
    would walk on ground that the reference did not see, were it as busy.
    """

    places: Array
    shares: Array
    unseen: Array
    block_m: float

    def seen_from(self, intrinsics: Intrinsics, candidates: Array) -> tuple[Array, Array]:
        """Shares (..., S) of people, and of those on unseen ground (...), in view (..., 4)."""
        seen, unseen = sums_in_view(
            _lens(intrinsics),
            _cameras(candidates),
            _blocks(self.places, self.block_m),
            np.ascontiguousarray(self.shares),
            np.ascontiguousarray(self.unseen),
        )
        batch = candidates.shape[:-1]
        return seen.reshape(*batch, -1), unseen.reshape(batch)


def anchored_shares(
    coverage: Coverage,
    density: PathDensityMap,
    intrinsics: Intrinsics,
    candidates: Array,
    anchor: Array,
) -> Array:
    """Shares (..., S) of people in parts of the picture that see ground the reference saw.

    Which do is by an anchor (4,), and stays so while the candidates (..., 4) move: what people in
    them say must not hang on where seen ground ends.
    """
    sums = seen_sums_in_view(
        _lens(intrinsics),
        _cameras(candidates),
        _blocks(coverage.places, coverage.block_m),
        np.ascontiguousarray(coverage.shares),
        density.grid,
        rotation_from_angles(anchor[0], anchor[1], anchor[3]),
        math.exp(anchor[2]),
    )
    return sums.reshape(*candidates.shape[:-1], -1)


def in_view(intrinsics: Intrinsics, candidates: Array, places: Array, size_m: float) -> Array:
    """The part (..., B) of pieces of ground around places (B, 2) that cameras (..., 4) see.

    A piece crosses the edge bit by bit, so that the part has slopes and no steps. Lens distortion
    is left out.
    """
    parts = parts_in_view(_lens(intrinsics), _cameras(candidates), _blocks(places, size_m))
    return parts.reshape(*candidates.shape[:-1], len(places))


def _lens(intrinsics: Intrinsics) -> Lens:
    seen = intrinsics.pinhole
    return Lens(*(float(getattr(seen, name)) for name in Lens._fields))


def _cameras(candidates: Array) -> Cameras:
    """The cameras at candidates (..., 4)."""
    flat = candidates.reshape(-1, 4)
    if len(flat) == 1:  # numbers are turned into a matrix in a tenth of the time
        rotations = rotation_from_angles(flat[0, 0], flat[0, 1], flat[0, 3])[None]
    else:
        rotations = rotation_from_angles(flat[:, 0], flat[:, 1], flat[:, 3])
    return Cameras(rotations=rotations, heights_m=np.exp(flat[:, 2]))


def _blocks(places: Array, size_m: float) -> Blocks:
    return Blocks(
        x_m=np.ascontiguousarray(places[:, 0]),
        y_m=np.ascontiguousarray(places[:, 1]),
        size_m=float(size_m),
    )


def coverage_of(density: PathDensityMap) -> Coverage:
    """The map in blocks of 3 x 3 nodes."""
    node = density.cell_m**2 * 2 * np.pi / config.DIRECTIONS
    slots, rows, columns, _ = density.log_density.shape
    block_rows, block_columns = -(-rows // config.BLOCK_NODES), -(-columns // config.BLOCK_NODES)
    padded = np.zeros(
        (slots + 1, block_rows * config.BLOCK_NODES, block_columns * config.BLOCK_NODES)
    )
    padded[:slots, :rows, :columns] = np.exp(density.log_density).sum(axis=3) * node
    padded[slots, :rows, :columns] = (
        np.exp(density.log_level) * density.unseen * node * config.DIRECTIONS
    )
    sides = (slots + 1, block_rows, config.BLOCK_NODES, block_columns, config.BLOCK_NODES)
    blocks = padded.reshape(sides).sum(axis=(2, 4))
    corners = np.indices((block_rows, block_columns)).reshape(2, -1).T * config.BLOCK_NODES
    return Coverage(
        places=density.corner + (corners + (config.BLOCK_NODES - 1) / 2) * density.cell_m,
        shares=blocks[:slots].reshape(slots, -1),
        unseen=blocks[slots].ravel(),
        block_m=config.BLOCK_NODES * density.cell_m,
    )
