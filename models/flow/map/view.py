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

    def seen_from(self, intrinsics: Intrinsics, candidate: Array) -> tuple[Array, float]:
        """Shares (S,) of the people, and the unknown ones, where a camera (4,) looks."""
        seen = in_view(intrinsics, candidate, self.places, self.block_m)
        return self.shares @ seen, float(self.unknown @ seen)


def known_shares(
    coverage: Coverage, flow: FlowMap, intrinsics: Intrinsics, candidate: Array, anchor: Array
) -> Array:
    """Shares (S,) of people in those parts of the picture that see known ground from an anchor.

    The parts of the picture stay as they are while the candidate (4,) moves: what people in them
    say must not hang on where known ground ends.
    """
    seen = in_view(intrinsics, candidate, coverage.places, coverage.block_m)
    rotation = rotation_from_angles(candidate[0], candidate[1], candidate[3])
    height = np.full((len(coverage.places), 1), -np.exp(candidate[2]))
    rays = np.concatenate([coverage.places, height], axis=1) @ rotation.T
    there = rays @ rotation_from_angles(anchor[0], anchor[1], anchor[3])
    down = np.where(there[:, 2] < -_NEAREST_M, -there[:, 2], np.inf)
    unseen, _ = flow.look_unseen(there[:, :2] * (np.exp(anchor[2]) / down)[:, None])
    return np.asarray(coverage.shares @ (seen * (1 - unseen)))


def in_view(intrinsics: Intrinsics, candidate: Array, places: Array, size_m: float) -> Array:
    """Which part (B,) of pieces of ground around places (B, 2) a camera (4,) sees.

    A piece crosses the edge bit by bit, so that the part has slopes and no steps. Lens distortion
    is left out.
    """
    tilt, roll, log_height, heading = candidate
    rotation = rotation_from_angles(tilt, roll, heading)
    height = np.full((len(places), 1), -np.exp(log_height))
    rays = np.concatenate([places, height], axis=1) @ rotation.T
    ahead = rays[:, 2] > _NEAREST_M
    depth = np.where(ahead, rays[:, 2], 1.0)
    u = intrinsics.fx * rays[:, 0] / depth + intrinsics.cx
    v = intrinsics.fy * rays[:, 1] / depth + intrinsics.cy
    blur = intrinsics.fx * size_m / depth
    inside = ahead.astype(np.float64)
    for at, size in ((u, intrinsics.width), (v, intrinsics.height)):
        inside *= np.clip(at / blur + 0.5, 0, 1) * np.clip((size - at) / blur + 0.5, 0, 1)
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
