"""One block of ground: which part of it is in a camera's picture.

Each side of the picture is as far from a block, in block sizes, as a linear function of its place
says: the depth by which a pixel is divided is also what a block's size in pixels is divided by.
"""

from typing import NamedTuple

from models.compiled import compiled
from models.geometry.rotation import Array

NEAREST_M = 0.1


class Lens(NamedTuple):
    """The intrinsics, in pixels, without distortion."""

    fx: float
    fy: float
    cx: float
    cy: float
    width: float
    height: float


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
    """Which part, 0 to 1, of the block at a place is in the picture.

    A block crosses a side bit by bit, so that the part has slopes and no steps.
    """
    across = _within(frame.left, x_m, y_m) * _within(frame.right, x_m, y_m)
    along = _within(frame.upper, x_m, y_m) * _within(frame.lower, x_m, y_m)
    return across * along if _at(frame.depth, x_m, y_m) > NEAREST_M else 0.0


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
