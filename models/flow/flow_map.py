"""The flow map: how often people are where, and which way they walk, on a grid of the ground."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from models.flow.placement import Placement
from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array, rotation_from_angles

DIRECTIONS = 16
_CELL_M = 0.5
_MOST_CELLS = 160  # along one side of the grid; a wider site has larger cells
_MARGIN_M = 12.0  # around where people were seen: where a knock may put them
_SMOOTH_M = 1.0
_SMOOTH_KAPPA = 6.0  # of the von Mises kernel over directions: 24 deg
_ANYWHERE = 0.1  # of all people walk anywhere in the grid, any way
_ANY_WAY = 0.15  # of those at a place walk any way
_QUANTILE = 0.002  # of the places at each side are left out of the grid
_BLOCK = 3  # cells along a side that are looked at as one for what a camera sees
_NEAREST_M = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class FlowMap:
    """A log density (X, Y, 16) over place (1/m^2) and direction (1/rad) at grid nodes.

    Nodes stand `cell_m` apart from `corner` (2,) on; directions from +X on, evenly. `elsewhere` is
    the log density off the grid.
    """

    corner: Array
    cell_m: float
    log_density: Array
    elsewhere: float

    def look(self, place: Array, direction: Array) -> tuple[Array, Array, Array]:
        """Log densities (M,) and their derivatives by place (M, 2) and direction (M,)."""
        at = (place - self.corner) / self.cell_m
        size = np.array(self.log_density.shape[:2])
        inside = np.all((at >= 0) & (at < size - 1.001), axis=1)
        at = np.where(inside[:, None], at, 0.5)
        first = np.floor(at).astype(np.int64)
        turn = (direction % (2 * np.pi)) / (2 * np.pi) * DIRECTIONS
        way = np.floor(turn).astype(np.int64)
        parts = np.concatenate([at - first, (turn - way)[:, None]], axis=1)
        value, slopes = np.zeros(len(at)), np.zeros((len(at), 3))
        for corner in np.ndindex(2, 2, 2):
            sides = np.array(corner)
            share = np.where(sides == 1, parts, 1 - parts)
            node = self.log_density[
                first[:, 0] + corner[0],
                first[:, 1] + corner[1],
                (way + corner[2]) % DIRECTIONS,
            ]
            value += share.prod(axis=1) * node
            sign = 2 * sides - 1
            slopes[:, 0] += sign[0] * share[:, 1] * share[:, 2] * node
            slopes[:, 1] += sign[1] * share[:, 0] * share[:, 2] * node
            slopes[:, 2] += sign[2] * share[:, 0] * share[:, 1] * node
        slopes *= np.array([1 / self.cell_m, 1 / self.cell_m, DIRECTIONS / (2 * np.pi)])
        slopes[~inside] = 0.0
        return np.where(inside, value, self.elsewhere), slopes[:, :2], slopes[:, 2]


@dataclass(frozen=True, slots=True, kw_only=True)
class Coverage:
    """The map in blocks, to tell how much of it a camera sees: places (B, 2) and shares (B,)."""

    places: Array
    shares: Array
    block_m: float

    def seen_from(self, intrinsics: Intrinsics, candidate: Array) -> float:
        """The share of all people who are where a camera (4,) looks; lens distortion left out."""
        tilt, roll, log_height, heading = candidate
        rotation = rotation_from_angles(tilt, roll, heading)
        height = np.full((len(self.places), 1), -np.exp(log_height))
        rays = np.concatenate([self.places, height], axis=1) @ rotation.T
        ahead = rays[:, 2] > _NEAREST_M
        depth = np.where(ahead, rays[:, 2], 1.0)
        u = intrinsics.fx * rays[:, 0] / depth + intrinsics.cx
        v = intrinsics.fy * rays[:, 1] / depth + intrinsics.cy
        # A block crosses the edge bit by bit, so that the share has slopes and no steps.
        blur = intrinsics.fx * self.block_m / depth
        inside = ahead.astype(np.float64)
        for at, size in ((u, intrinsics.width), (v, intrinsics.height)):
            inside *= np.clip(at / blur + 0.5, 0, 1) * np.clip((size - at) / blur + 0.5, 0, 1)
        return float(self.shares @ inside)


def learn_map(placed: Placement, weight: Array) -> FlowMap:
    """The map of steps whose pose is known, each counted by its weight (M,).

    Raises:
        ValueError: no step counts.
    """
    used = placed.valid & (weight > 0)
    if not used.any():
        raise ValueError("steps: at least one must count, got none")
    place, direction, weight = placed.place[used], placed.direction[used], weight[used]
    low, high = (np.quantile(place, q, axis=0) for q in (_QUANTILE, 1 - _QUANTILE))
    low, high = low - _MARGIN_M, high + _MARGIN_M
    cell_m = max(_CELL_M, float((high - low).max()) / (_MOST_CELLS - 2))
    size = np.ceil((high - low) / cell_m).astype(np.int64) + 2
    counts = _binned((place - low) / cell_m, direction, weight, size)
    smooth = _smoothed(counts, _SMOOTH_M / cell_m)
    smooth = (1 - _ANY_WAY) * smooth + _ANY_WAY * smooth.mean(axis=2, keepdims=True)
    share = smooth / smooth.sum() * (1 - _ANYWHERE) + _ANYWHERE / smooth.size
    node = cell_m**2 * 2 * np.pi / DIRECTIONS
    return FlowMap(
        corner=low,
        cell_m=cell_m,
        log_density=np.log(share / node),
        elsewhere=float(np.log(_ANYWHERE / smooth.size / node)),
    )


def coverage_of(flow: FlowMap) -> Coverage:
    """The map in blocks of 3 x 3 nodes."""
    node = flow.cell_m**2 * 2 * np.pi / DIRECTIONS
    shares = np.exp(flow.log_density).sum(axis=2) * node
    rows, columns = (-(-length // _BLOCK) for length in shares.shape)
    padded = np.zeros((rows * _BLOCK, columns * _BLOCK))
    padded[: shares.shape[0], : shares.shape[1]] = shares
    blocks = padded.reshape(rows, _BLOCK, columns, _BLOCK).sum(axis=(1, 3))
    middle = (
        np.indices((rows, columns)).reshape(2, -1).T * _BLOCK + (_BLOCK - 1) / 2
    ) * flow.cell_m
    return Coverage(
        places=flow.corner + middle, shares=blocks.ravel(), block_m=_BLOCK * flow.cell_m
    )


def _binned(at: Array, direction: Array, weight: Array, size: npt.NDArray[np.int64]) -> Array:
    """Weights spread linearly over the nodes (X, Y, 16) around each step."""
    turn = (direction % (2 * np.pi)) / (2 * np.pi) * DIRECTIONS
    at = np.clip(at, 0, size - 1.001)
    first, way = np.floor(at).astype(np.int64), np.floor(turn).astype(np.int64)
    parts = np.concatenate([at - first, (turn - way)[:, None]], axis=1)
    counts = np.zeros((*size, DIRECTIONS))
    for corner in np.ndindex(2, 2, 2):
        share = np.where(np.array(corner) == 1, parts, 1 - parts).prod(axis=1)
        node = (first[:, 0] + corner[0], first[:, 1] + corner[1], (way + corner[2]) % DIRECTIONS)
        np.add.at(counts, node, weight * share)
    return counts


def _smoothed(counts: Array, sd_cells: float) -> Array:
    """Counts (X, Y, 16) smoothed by a Gaussian over places and a von Mises over directions."""
    rates = [2 * np.pi * np.fft.fftfreq(length) for length in counts.shape[:2]]
    places = np.exp(-0.5 * sd_cells**2 * (rates[0][:, None] ** 2 + rates[1] ** 2))
    angles = np.arange(DIRECTIONS) * 2 * np.pi / DIRECTIONS
    kernel = np.exp(_SMOOTH_KAPPA * (np.cos(angles) - 1))
    ways = np.fft.fft(kernel / kernel.sum())
    smooth = np.fft.ifftn(np.fft.fftn(counts) * places[:, :, None] * ways).real
    return np.asarray(np.clip(smooth, 0.0, None))
