"""Outlines that were drawn in a picture, and where they are once the camera has moved.

What lies on the ground goes by the ground's homography between the two poses. What does not, or is
far away, goes by the rotation alone, K R K^-1: of a camera that has also changed its place, near
things are elsewhere by parallax, which nobody can tell without their distance.
Edges are straight between corners in either picture: a lens that bends is right at the corners.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.geometry.drawn_outlines import DrawnOutline, clipped, drawn_outline, inside
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.propagation import error_ellipses
from models.geometry.rotation import Array

_SIDES, _WIDEST = 16, 8.0  # of the cone that a lens sees, at the most: 83 deg off the axis
_NEAR = 0.01  # of the picture's width: so near to a line is on it


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


def moved_outlines(
    outlines: Sequence[Outline], now: View, covariance: Array | None
) -> list[MovedOutline]:
    """Outlines in another view.

    Args:
        outlines: as they were drawn.
        now: the view in which they are wanted.
        covariance: (4, 4) of the pose of `now` relative to that of the drawing; None if unknown.
    """
    cone, turn = _cone(now.intrinsics), now.pose.rotation
    parts, shares = [np.zeros((0, 3))], []
    for outline in outlines:
        drawn = drawn_outline(
            outline.corners, outline.drawn.intrinsics, outline.drawn.pose, outline.on_ground
        )
        away = _from_camera(outline, drawn.corners, now.pose)
        parts.append(clipped(away @ turn.T, cone, closed=outline.closed))
        shares.append(_shares(outline, drawn, now))
    counts = [len(part) for part in parts[1:]]
    seen = np.concatenate(parts)
    away = seen @ turn
    # What is on the ground is as much lower as the camera is higher.
    drop = np.zeros_like(away)
    drop[:, 2] = np.repeat([outline.on_ground for outline in outlines], counts)

    def placed(rotation: Array, height_m: float) -> Array:
        lowered = away + (now.pose.height_m - height_m) * drop
        return now.intrinsics.project(lowered @ rotation.T)[0]

    corners, _ = now.intrinsics.project(seen)
    ellipses = None if covariance is None else error_ellipses(placed, now.pose, covariance)
    found, first = [], 0
    for count, (in_view, overlap) in zip(counts, shares, strict=True):
        own = slice(first, first + count)
        found.append(
            MovedOutline(
                corners=corners[own],
                ellipses=None if ellipses is None else ellipses[own],
                in_view=in_view,
                overlap=overlap,
            )
        )
        first += count
    return found


def _shares(outline: Outline, drawn: DrawnOutline, now: View) -> tuple[float, float]:
    """The shares of an outline that are in the image, and that are still where it was drawn."""
    if not len(drawn.samples):
        return 0.0, 0.0
    away = _from_camera(outline, drawn.samples, now.pose)
    uv, _ = now.intrinsics.project(away @ now.pose.rotation.T)
    seen = now.intrinsics.contains(uv)
    there = seen.copy()
    there[seen] = inside(uv[seen], outline.corners, now.intrinsics.width * _NEAR)
    return float(seen.mean()), float((drawn.weights * there).sum() / drawn.weights.sum())


def within_picture(corners: Array, intrinsics: Intrinsics, *, closed: bool) -> Array:
    """What of an outline (N, 2) in pixels is in the picture (M, 2)."""
    left, top = np.array([1.0, 0.0, 0.5]), np.array([0.0, 1.0, 0.5])
    right = np.array([-1.0, 0.0, intrinsics.width - 0.5])
    bottom = np.array([0.0, -1.0, intrinsics.height - 0.5])
    flat = np.column_stack([corners, np.ones(len(corners))])
    return clipped(flat, np.array([left, top, right, bottom]), closed=closed)[:, :2]


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
