"""The coverage of a map by a camera: people who are not in the picture give no track.

Ours: share = sum over blocks of the map's people times the part of the block in the picture.
"""

import math
from dataclasses import dataclass

import numpy as np

from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array, rotation_from_angles
from models.paths.config import BLOCK_NODES, DIRECTIONS
from models.paths.density_map import PathDensityMap
from models.paths.field_of_view import (
    Blocks,
    Cameras,
    Lens,
    parts_in_view,
    seen_sums_in_view,
    sums_in_view,
)


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
    return Lens(
        fx=float(intrinsics.fx),
        fy=float(intrinsics.fy),
        cx=float(intrinsics.cx),
        cy=float(intrinsics.cy),
        width=float(intrinsics.width),
        height=float(intrinsics.height),
    )


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
    node = density.cell_m**2 * 2 * np.pi / DIRECTIONS
    slots, rows, columns, _ = density.log_density.shape
    block_rows, block_columns = -(-rows // BLOCK_NODES), -(-columns // BLOCK_NODES)
    padded = np.zeros((slots + 1, block_rows * BLOCK_NODES, block_columns * BLOCK_NODES))
    padded[:slots, :rows, :columns] = np.exp(density.log_density).sum(axis=3) * node
    padded[slots, :rows, :columns] = np.exp(density.log_level) * density.unseen * node * DIRECTIONS
    sides = (slots + 1, block_rows, BLOCK_NODES, block_columns, BLOCK_NODES)
    blocks = padded.reshape(sides).sum(axis=(2, 4))
    corners = np.indices((block_rows, block_columns)).reshape(2, -1).T * BLOCK_NODES
    return Coverage(
        places=density.corner + (corners + (BLOCK_NODES - 1) / 2) * density.cell_m,
        shares=blocks[:slots].reshape(slots, -1),
        unseen=blocks[slots].ravel(),
        block_m=BLOCK_NODES * density.cell_m,
    )
