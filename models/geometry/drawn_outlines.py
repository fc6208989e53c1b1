"""Outlines as they were drawn: all that depends on the drawing alone, and is cached."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from models.geometry.footprint import REACH
from models.geometry.ground import LOWEST_SINE
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array, Mask

_ACROSS = 48  # samples of a line, and across an area: shares are right within 0.02
_FEWEST = 32  # samples inside an area; of a narrower one its edges are sampled
_ON_EDGES = 1024  # samples of all edges of an area together
_PAIRS = 200_000  # of a pixel and an edge, compared at once
_CACHED = 256  # outlines, at most 74 kB each


class DrawnOutline(NamedTuple):
    """World directions of an outline that was drawn, from the camera's centre.

    `corners` (M, 3); `samples` (N, 3) with the weight (N,) of each. On the ground, what is above
    the horizon is cut off, and the weight is the area of a sample: up to `REACH` camera heights
    away if any of the outline is that near.
    """

    corners: Array
    samples: Array
    weights: Array


def drawn_outline(
    corners: Array, intrinsics: Intrinsics, pose: CameraPose, on_ground: bool
) -> DrawnOutline:
    """Directions of an outline by the lens and the pose at which it was drawn; cached.

    Args:
        corners: pixels (M, 2); two are a line.
        intrinsics: the lens.
        pose: of the camera.
        on_ground: whether the outline is on the ground.
    """
    return _drawn_outline(corners.tobytes(), intrinsics, pose, on_ground)


@lru_cache(maxsize=_CACHED)
def _drawn_outline(
    corners: bytes, intrinsics: Intrinsics, pose: CameraPose, on_ground: bool
) -> DrawnOutline:
    drawn = np.frombuffer(corners, dtype=np.float64).reshape(-1, 2)
    uv = np.concatenate([drawn, _samples(drawn)])
    rays, on_ray = intrinsics.rays(uv)
    rays = rays @ pose.rotation
    edge, samples = rays[: len(drawn)][on_ray[: len(drawn)]], rays[len(drawn) :]
    samples = samples[on_ray[len(drawn) :]]
    weights = np.ones(len(samples))
    if on_ground:
        below = np.array([[0.0, 0.0, -1.0]]) - LOWEST_SINE * pose.rotation[2]
        edge = clipped(edge, below, closed=len(drawn) > 2)
        samples = samples[-samples[:, 2] > LOWEST_SINE]
        down = -samples[:, 2]
        weights = down**-3.0  # the ground's area by the image's, of a pinhole
        near = np.hypot(samples[:, 0], samples[:, 1]) < REACH * down
        weights = np.where(near, weights, 0.0) if near.any() else weights
    for array in (edge, samples, weights):
        array.setflags(write=False)
    return DrawnOutline(corners=edge, samples=samples, weights=weights)


def clipped(points: Array, planes: Array, *, closed: bool) -> Array:
    """A polygon (M, 3), or an open line, of what of another (N, 3) is on the positive sides.

    `planes` are normals (K, 3) of planes through the origin.

    Source: Sutherland and Hodgman, "Reentrant Polygon Clipping", 1974.
    """
    if (points @ planes.T >= 0).all():
        return points
    for plane in planes:
        if not len(points):
            break
        here = points @ plane
        before, points_before = np.roll(here, 1), np.roll(points, 1, axis=0)
        crosses = here * before < 0
        crosses[0] &= closed
        share = here / np.where(crosses, here - before, 1.0)
        crossed = points + share[:, None] * (points_before - points)
        both = np.stack([crossed, points], axis=1)  # in this order along the outline
        points = both[np.stack([crosses, here >= 0], axis=1)]
    return points


def inside(uv: Array, corners: Array, near_px: float) -> Mask:
    """Which pixels (N,) are inside an area's corners (M, 2), by even and odd; or near to a line."""
    if len(corners) <= 2:
        along = corners[-1] - corners[0]
        at = np.clip((uv - corners[0]) @ along / max(along @ along, 1e-12), 0, 1)
        off = uv - corners[0] - at[:, None] * along
        return np.asarray(np.hypot(off[:, 0], off[:, 1]) <= near_px)
    x, y = corners.T
    to_y = np.roll(y, -1)
    slopes = (np.roll(x, -1) - x) / np.where(to_y == y, 1.0, to_y - y)  # a level edge never counts
    odd = np.empty(len(uv), dtype=bool)
    step = max(1, _PAIRS // len(corners))
    for first in range(0, len(uv), step):
        u, v = uv[first : first + step].T[..., None]
        crosses = (v < y) != (v < to_y)
        odd[first : first + step] = np.logical_xor.reduce(
            crosses & (u < x + (v - y) * slopes), axis=1
        )
    return odd


def _samples(corners: Array) -> Array:
    """Pixels (N, 2) evenly over an outline; at most 2,304."""
    if len(corners) <= 2:
        return _along(corners, _ACROSS)
    low, high = corners.min(axis=0), corners.max(axis=0)
    steps = (np.arange(_ACROSS) + 0.5) / _ACROSS
    grid = np.stack(np.meshgrid(*(low + np.outer(steps, high - low)).T), axis=-1)
    lattice = grid.reshape(-1, 2)
    found = lattice[inside(lattice, corners, 0.0)]
    if len(found) >= _FEWEST:
        return found
    return _along(np.concatenate([corners, corners[:1]]), _ON_EDGES)


def _along(corners: Array, count: int) -> Array:
    """Pixels (count, 2) at even distances along a line through corners, both ends included."""
    lengths = np.hypot(*np.diff(corners, axis=0).T)
    at = np.concatenate([[0.0], np.cumsum(lengths)])
    wanted = np.linspace(0.0, at[-1], count)
    return np.column_stack([np.interp(wanted, at, corners[:, axis]) for axis in (0, 1)])
