"""How much of a flow map a camera sees: people who are not in the picture give no track.

Ours: share = sum over blocks of the map's people times the part of the block in the picture.
"""

import math
from dataclasses import dataclass

import numpy as np

from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array, rotation_from_angles
from models.paths.compiled.block import Lens
from models.paths.compiled.views import known_sums_in_view, parts_in_view, sums_in_view
from models.paths.map.density_map import DIRECTIONS, FlowMap

_BLOCK = 3  # nodes along a side that are looked at as one


@dataclass(frozen=True, slots=True, kw_only=True)
class Coverage:
    """The map in blocks of ground: places (B, 2), with how many people walk there.

    `shares` (S, B) are those of the known ground in each part of the day, `unknown` (B,) those
    that would walk on ground that the reference did not see, were it as busy as the known.
    """

    places: Array
    shares: Array
    unknown: Array
    block_m: float

    def seen_from(self, intrinsics: Intrinsics, candidates: Array) -> tuple[Array, Array]:
        """Shares (..., S) of people, and of unknown ones (...), where cameras (..., 4) look."""
        known, beyond = sums_in_view(
            _lens(intrinsics),
            *_cameras(candidates),
            *_columns(self.places),
            float(self.block_m),
            np.ascontiguousarray(self.shares),
            np.ascontiguousarray(self.unknown),
        )
        batch = candidates.shape[:-1]
        return known.reshape(*batch, -1), beyond.reshape(batch)


def known_shares(
    coverage: Coverage, flow: FlowMap, intrinsics: Intrinsics, candidates: Array, anchor: Array
) -> Array:
    """Shares (..., S) of people in parts of the picture that see known ground from an anchor.

    These parts stay as they are while the candidates (..., 4) move: what people in them
    say must not hang on where known ground ends.
    """
    known = known_sums_in_view(
        _lens(intrinsics),
        *_cameras(candidates),
        *_columns(coverage.places),
        float(coverage.block_m),
        np.ascontiguousarray(coverage.shares),
        flow.grid,
        rotation_from_angles(anchor[0], anchor[1], anchor[3]),
        math.exp(anchor[2]),
    )
    return known.reshape(*candidates.shape[:-1], -1)


def in_view(intrinsics: Intrinsics, candidates: Array, places: Array, size_m: float) -> Array:
    """Which part (..., B) of pieces of ground around places (B, 2) cameras (..., 4) see.

    A piece crosses the edge bit by bit, so that the part has slopes and no steps. Lens distortion
    is left out.
    """
    parts = parts_in_view(
        _lens(intrinsics), *_cameras(candidates), *_columns(places), float(size_m)
    )
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


def _cameras(candidates: Array) -> tuple[Array, Array]:
    """Rotations (K, 3, 3) and heights (K,) in metres of candidates (..., 4)."""
    flat = candidates.reshape(-1, 4)
    if len(flat) == 1:  # numbers are turned into a matrix in a tenth of the time
        rotations = rotation_from_angles(flat[0, 0], flat[0, 1], flat[0, 3])[None]
    else:
        rotations = rotation_from_angles(flat[:, 0], flat[:, 1], flat[:, 3])
    return rotations, np.exp(flat[:, 2])


def _columns(places: Array) -> tuple[Array, Array]:
    """Both coordinates (B,) of places (B, 2), each in a row in memory."""
    return np.ascontiguousarray(places[:, 0]), np.ascontiguousarray(places[:, 1])


def coverage_of(flow: FlowMap) -> Coverage:
    """The map in blocks of 3 x 3 nodes."""
    node = flow.cell_m**2 * 2 * np.pi / DIRECTIONS
    slots, rows, columns, _ = flow.log_density.shape
    known = np.exp(flow.log_density).sum(axis=3) * node
    unknown = np.exp(flow.log_level) * flow.unseen * node * DIRECTIONS
    block_rows, block_columns = -(-rows // _BLOCK), -(-columns // _BLOCK)
    padded = np.zeros((slots + 1, block_rows * _BLOCK, block_columns * _BLOCK))
    padded[:slots, :rows, :columns] = known
    padded[slots, :rows, :columns] = unknown
    blocks = padded.reshape(slots + 1, block_rows, _BLOCK, block_columns, _BLOCK).sum(axis=(2, 4))
    middle = np.indices((block_rows, block_columns)).reshape(2, -1).T * _BLOCK + (_BLOCK - 1) / 2
    return Coverage(
        places=flow.corner + middle * flow.cell_m,
        shares=blocks[:slots].reshape(slots, -1),
        unknown=blocks[slots].ravel(),
        block_m=_BLOCK * flow.cell_m,
    )
