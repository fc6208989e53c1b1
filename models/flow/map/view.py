"""How much of a flow map a camera sees: people who are not in the picture give no track.

Ours: share = sum over blocks of the map's people times the part of the block in the picture.
"""

from dataclasses import dataclass

import numpy as np

from models.flow.map.flow_map import DIRECTIONS, FlowMap
from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array, rotation_from_angles

_BLOCK = 3  # nodes along a side that are looked at as one
_NEAREST_M = 0.1


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
        seen = in_view(intrinsics, candidates, self.places, self.block_m)
        return seen @ self.shares.T, seen @ self.unknown


def known_shares(
    coverage: Coverage, flow: FlowMap, intrinsics: Intrinsics, candidates: Array, anchor: Array
) -> Array:
    """Shares (..., S) of people in parts of the picture that see known ground from an anchor.

    These parts stay as they are while the candidates (..., 4) move: what people in them
    say must not hang on where known ground ends.
    """
    rays = _rays(candidates, coverage.places)
    there = rays @ rotation_from_angles(anchor[0], anchor[1], anchor[3])
    down = np.where(there[..., 2] < -_NEAREST_M, -there[..., 2], np.inf)
    places = there[..., :2] * (np.exp(anchor[2]) / down)[..., None]
    unseen, _ = flow.look_unseen(places.reshape(-1, 2))
    seen = _inside(intrinsics, rays, coverage.block_m) * (1 - unseen.reshape(down.shape))
    return np.asarray(seen @ coverage.shares.T)


def in_view(intrinsics: Intrinsics, candidates: Array, places: Array, size_m: float) -> Array:
    """Which part (..., B) of pieces of ground around places (B, 2) cameras (..., 4) see.

    A piece crosses the edge bit by bit, so that the part has slopes and no steps. Lens distortion
    is left out.
    """
    return _inside(intrinsics, _rays(candidates, places), size_m)


def _rays(candidates: Array, places: Array) -> Array:
    """Rays (..., B, 3) of cameras (..., 4) to places (B, 2)."""
    rotations = rotation_from_angles(candidates[..., 0], candidates[..., 1], candidates[..., 3])
    below = np.exp(candidates[..., 2])[..., None, None] * rotations[..., None, :, 2]
    return np.asarray(places @ np.swapaxes(rotations[..., :2], -1, -2) - below)


def _inside(intrinsics: Intrinsics, rays: Array, size_m: float) -> Array:
    """Which part (...) of pieces of ground along rays (..., 3) is in the picture."""
    ahead = rays[..., 2] > _NEAREST_M
    per_depth = 1 / np.where(ahead, rays[..., 2], 1.0)
    edge = 1 / (intrinsics.fx * size_m * per_depth)
    u = (intrinsics.fx * rays[..., 0] * per_depth + intrinsics.cx) * edge
    v = (intrinsics.fy * rays[..., 1] * per_depth + intrinsics.cy) * edge
    inside = ahead.astype(np.float64)
    for at, size in ((u, intrinsics.width), (v, intrinsics.height)):
        inside *= np.minimum(np.maximum(at + 0.5, 0), 1)
        inside *= np.minimum(np.maximum(size * edge - at + 0.5, 0), 1)
    return inside


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
