"""Outlines that were drawn in a picture, and where they are once the camera has moved.

What lies on the ground goes by the ground's homography between the two poses. What does not, or is
far away, goes by the rotation alone, K R K^-1: of a camera that has also changed its place, near
things are elsewhere by parallax, which nobody can tell without their distance.
Edges are straight between corners in either picture: a lens that bends is right at the corners.
"""

from dataclasses import dataclass

import numpy as np

from models.geometry.footprint import REACH
from models.geometry.ground import LOWEST_SINE
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.propagation import error_ellipses
from models.geometry.rotation import Array, Mask

_SIDES, _WIDEST = 16, 8.0  # of the cone that a lens sees, at the most: 83 deg off the axis
_ACROSS = 64  # samples of an outline: shares are right within 2 of 100
_NEAR = 0.01  # of the picture's width: so near to a line is on it
_FEWEST = 32  # samples: of what is narrower, its edges are taken


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """A lens and where it stands."""

    intrinsics: Intrinsics
    pose: CameraPose


@dataclass(frozen=True, slots=True, kw_only=True)
class Outline:
    """Corners (N, 2) in pixels as they were drawn in a view; two of them are a line."""

    corners: Array
    drawn: View
    on_ground: bool

    @property
    def closed(self) -> bool:
        """True of an area, false of a line."""
        return len(self.corners) > 2


@dataclass(frozen=True, slots=True, kw_only=True)
class MovedOutline:
    """Corners (M, 2) in a view, maybe outside the picture, and their ellipses (M, 3) if known.

    None are left of what is behind the camera or beyond the horizon; where it is cut there, there
    are others than were drawn. `in_view` is the share of what was drawn that the picture shows.
    `overlap` is the share that still lies where it was drawn, if nobody mends the drawing: of what
    was meant, how much is within the same pixels by now. On the ground that is by its area, up to
    10 camera heights away where any of it is so near; else by its area in the picture.
    """

    corners: Array
    ellipses: Array | None
    in_view: float
    overlap: float


def moved_outline(outline: Outline, now: View, covariance: Array | None) -> MovedOutline:
    """An outline in another view, with the errors of that view's pose (4, 4) against the first."""
    rays, on_ray = outline.drawn.intrinsics.rays(outline.corners)
    directions = rays[on_ray] @ outline.drawn.pose.rotation
    if outline.on_ground:
        forward = outline.drawn.pose.rotation[2]
        below = np.array([[0.0, 0.0, -1.0]]) - LOWEST_SINE * forward
        directions = clipped(directions, below, closed=outline.closed)
    away = _from_camera(outline, directions, now.pose)
    seen = clipped(away @ now.pose.rotation.T, _cone(now.intrinsics), closed=outline.closed)
    corners, _ = now.intrinsics.project(seen)
    away = seen @ now.pose.rotation

    def placed(rotation: Array, height_m: float) -> Array:
        # What is on the ground is as much lower as the camera is higher.
        drop = np.array([0.0, 0.0, now.pose.height_m - height_m]) * outline.on_ground
        return now.intrinsics.project((away + drop) @ rotation.T)[0]

    in_view, overlap = _shares(outline, now)
    ellipses = None if covariance is None else error_ellipses(placed, now.pose, covariance)
    return MovedOutline(corners=corners, ellipses=ellipses, in_view=in_view, overlap=overlap)


def _shares(outline: Outline, now: View) -> tuple[float, float]:
    """The shares of an outline that are in the picture, and that still lie where it was drawn."""
    uv, weights = _samples_now(outline, now)
    if not len(uv):
        return 0.0, 0.0
    seen = now.intrinsics.contains(uv)
    there = seen.copy()
    there[seen] = inside(uv[seen], outline.corners, now.intrinsics.width * _NEAR)
    return float(seen.mean()), float((weights * there).sum() / weights.sum())


def clipped(points: Array, planes: Array, *, closed: bool) -> Array:
    """A polygon (M, 3), or an open line, of what of another (N, 3) is on the positive sides.

    `planes` are normals (K, 3) of planes through the origin.

    Source: Sutherland and Hodgman, "Reentrant Polygon Clipping", 1974.
    """
    for plane in planes:
        if not len(points):
            break
        side = points @ plane
        kept = []
        for number, (point, here) in enumerate(zip(points, side, strict=True)):
            if (number or closed) and side[number - 1] * here < 0:
                share = here / (here - side[number - 1])
                kept.append(point + share * (points[number - 1] - point))
            if here >= 0:
                kept.append(point)
        points = np.array(kept).reshape(-1, 3)
    return points


def within_picture(corners: Array, intrinsics: Intrinsics, *, closed: bool) -> Array:
    """What of an outline (N, 2) in pixels is in the picture (M, 2)."""
    left, top = np.array([1.0, 0.0, 0.5]), np.array([0.0, 1.0, 0.5])
    right = np.array([-1.0, 0.0, intrinsics.width - 0.5])
    bottom = np.array([0.0, -1.0, intrinsics.height - 0.5])
    flat = np.column_stack([corners, np.ones(len(corners))])
    return clipped(flat, np.array([left, top, right, bottom]), closed=closed)[:, :2]


def inside(uv: Array, corners: Array, near_px: float) -> Mask:
    """Which pixels (N,) are inside an area's corners (M, 2), by even and odd; or near to a line."""
    begins, ends = corners, np.roll(corners, -1, axis=0)
    if len(corners) <= 2:
        along = corners[-1] - corners[0]
        at = np.clip((uv - corners[0]) @ along / max(along @ along, 1e-12), 0, 1)
        off = uv - corners[0] - at[:, None] * along
        return np.asarray(np.hypot(off[:, 0], off[:, 1]) <= near_px)
    odd = np.zeros(len(uv), dtype=bool)
    for (x, y), (to_x, to_y) in zip(begins, ends, strict=True):
        if y == to_y:
            continue
        crosses = (uv[:, 1] < y) != (uv[:, 1] < to_y)
        odd ^= crosses & (uv[:, 0] < x + (uv[:, 1] - y) * (to_x - x) / (to_y - y))
    return odd


def _from_camera(outline: Outline, directions: Array, pose: CameraPose) -> Array:
    """What lies in directions (N, 3) of the drawing, from a pose: axes as the world's."""
    if not outline.on_ground:
        return directions
    drawn = outline.drawn.pose
    ground = drawn.centre_m[:2] + drawn.height_m * directions[:, :2] / -directions[:, 2:]
    from_foot = ground - pose.centre_m[:2]
    return np.column_stack([from_foot, np.full(len(ground), -pose.height_m)])


def _cone(intrinsics: Intrinsics) -> Array:
    """Normals (K, 3) in the camera frame of a cone that the lens sees, in which it bends one way.

    It has flat sides within the round one.
    """
    widest = min(0.999 * intrinsics.max_radius, _WIDEST) * np.cos(np.pi / _SIDES)
    around = np.linspace(0, 2 * np.pi, _SIDES, endpoint=False)
    return np.column_stack([-np.cos(around), -np.sin(around), np.full(_SIDES, widest)])


def _samples(outline: Outline) -> Array:
    """Pixels (N, 2) evenly over an outline."""
    corners = outline.corners
    if outline.closed:
        low, high = corners.min(axis=0), corners.max(axis=0)
        steps = (np.arange(_ACROSS) + 0.5) / _ACROSS
        grid = np.stack(np.meshgrid(*(low + np.outer(steps, high - low)).T), axis=-1)
        lattice = grid.reshape(-1, 2)
        found = lattice[inside(lattice, corners, 0.0)]
        if len(found) >= _FEWEST:
            return found
    ends = np.roll(corners, -1, axis=0) if outline.closed else corners[1:]
    shares = np.linspace(0, 1, _ACROSS)[:, None]
    return np.concatenate(
        [
            begin + shares * (end - begin)
            for begin, end in zip(corners[: len(ends)], ends, strict=True)
        ]
    )


def _samples_now(outline: Outline, now: View) -> tuple[Array, Array]:
    """Samples of an outline where they are now (N, 2), and how much of it each stands for (N,).

    Of the ground that is its area, up to `REACH` camera heights away if any of it is so near.
    """
    rays, on_ray = outline.drawn.intrinsics.rays(_samples(outline))
    directions = (rays @ outline.drawn.pose.rotation)[on_ray]
    weights = np.ones(len(directions))
    if outline.on_ground:
        directions = directions[-directions[:, 2] > LOWEST_SINE]
        down = -directions[:, 2]
        weights = down**-3.0  # the ground's area by the picture's, of a pinhole
        near = np.hypot(directions[:, 0], directions[:, 1]) < REACH * down
        weights = np.where(near, weights, 0.0) if near.any() else weights
    away = _from_camera(outline, directions, now.pose)
    return now.intrinsics.project(away @ now.pose.rotation.T)[0], weights
