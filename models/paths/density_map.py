"""The path density map: how often people are where, and which way they walk, on a grid.

Log densities are rounded to 1/64, so that they are the same offline as they are stored. Between
nodes, loops read them with slopes. Places are in metres from the camera's foot point, directions in
radians from +X towards +Y.
"""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from models.compiled import compiled
from models.durations import DAY_S
from models.geometry.rotation import Array, Index
from models.paths import config

Four = tuple[float, float, float, float]

_TURNS_PER_RAD = 1 / (2 * math.pi)
_LAST = 1.001  # nodes: on the last one a place has no cell any more


class Grid(NamedTuple):
    """A map's `log_density` (S, X, Y, W), `unseen` (X, Y), `corner` (2,) and the rest."""

    log_density: Array
    unseen: Array
    corner: Array
    nodes_per_m: float
    elsewhere: float


class Cell(NamedTuple):
    """The node before a place, how far beyond it that is, and whether it is in the grid."""

    column: int
    row: int
    x: float
    y: float
    inside: bool


class Blend(NamedTuple):
    """A value between nodes, and its slopes by place (1/m)."""

    value: float
    by_x: float
    by_y: float


class LogDensity(NamedTuple):
    """A log density, and its slopes by place (1/m) and direction (1/rad)."""

    value: float
    by_x: float
    by_y: float
    by_direction: float


@compiled
def _cell_at(grid: Grid, x_m: float, y_m: float) -> Cell:
    """The cell of a place."""
    columns, rows = grid.unseen.shape
    x = (x_m - grid.corner[0]) * grid.nodes_per_m
    y = (y_m - grid.corner[1]) * grid.nodes_per_m
    if 0 <= x < columns - _LAST and 0 <= y < rows - _LAST:
        column, row = int(x), int(y)
        return Cell(column, row, x - column, y - row, True)
    return Cell(0, 0, 0.5, 0.5, False)


@compiled
def _blended(
    cell: Cell, nodes_per_m: float, first: float, second: float, third: float, fourth: float
) -> Blend:
    """Between the values at a cell's corners (0, 0), (0, 1), (1, 0), (1, 1)."""
    left, right = second - first, fourth - third
    low, high = first + left * cell.y, third + right * cell.y
    across = high - low
    return Blend(
        low + across * cell.x, across * nodes_per_m, (left + (right - left) * cell.x) * nodes_per_m
    )


@compiled
def unseen_at(grid: Grid, x_m: float, y_m: float) -> Blend:
    """The part of the ground at a place that was not seen; 0 outside of the grid."""
    cell = _cell_at(grid, x_m, y_m)
    if not cell.inside:
        return Blend(0.0, 0.0, 0.0)
    unseen, column, row = grid.unseen, cell.column, cell.row
    return _blended(
        cell,
        grid.nodes_per_m,
        unseen[column, row],
        unseen[column, row + 1],
        unseen[column + 1, row],
        unseen[column + 1, row + 1],
    )


@compiled
def _cubic(part: float) -> tuple[Four, Four]:
    """Shares of four directions in a row, a part of the way from the second to the third.

    With their slopes. Between straight lines a path's direction would be where a node is.
    Source: Catmull and Rom 1974, cubic splines through nodes.
    """
    squared, cubed = part * part, part * part * part
    shares = (
        (2 * squared - part - cubed) / 2,
        (2 - 5 * squared + 3 * cubed) / 2,
        (part + 4 * squared - 3 * cubed) / 2,
        (cubed - squared) / 2,
    )
    slopes = (
        (4 * part - 1 - 3 * squared) / 2,
        (9 * squared - 10 * part) / 2,
        (1 + 8 * part - 9 * squared) / 2,
        (3 * squared - 2 * part) / 2,
    )
    return shares, slopes


@compiled
def log_density_at(grid: Grid, slot: int, x_m: float, y_m: float, direction: float) -> LogDensity:
    """The log density at a place and direction in a part of the day."""
    cell = _cell_at(grid, x_m, y_m)
    if not cell.inside:
        return LogDensity(grid.elsewhere, 0.0, 0.0, 0.0)
    nodes, column, row = grid.log_density, cell.column, cell.row
    directions = nodes.shape[3]
    turns = direction * _TURNS_PER_RAD
    turn = (turns - math.floor(turns)) * directions
    way = int(turn)
    shares, slopes = _cubic(turn - way)
    value_0 = value_1 = value_2 = value_3 = 0.0
    turning_0 = turning_1 = turning_2 = turning_3 = 0.0
    for number in range(4):
        node = way + number - 1
        if node < 0:
            node += directions
        elif node >= directions:
            node -= directions
        share, slope = shares[number], slopes[number]
        node_0, node_1 = nodes[slot, column, row, node], nodes[slot, column, row + 1, node]
        node_2, node_3 = nodes[slot, column + 1, row, node], nodes[slot, column + 1, row + 1, node]
        value_0, turning_0 = value_0 + share * node_0, turning_0 + slope * node_0
        value_1, turning_1 = value_1 + share * node_1, turning_1 + slope * node_1
        value_2, turning_2 = value_2 + share * node_2, turning_2 + slope * node_2
        value_3, turning_3 = value_3 + share * node_3, turning_3 + slope * node_3
    at = _blended(cell, grid.nodes_per_m, value_0, value_1, value_2, value_3)
    turning = _blended(cell, grid.nodes_per_m, turning_0, turning_1, turning_2, turning_3)
    return LogDensity(at.value, at.by_x, at.by_y, turning.value * directions * _TURNS_PER_RAD)


@compiled
def log_densities_at(
    grid: Grid, place: Array, direction: Array, slot_idx: Index
) -> tuple[Array, Array, Array]:
    """Log densities (M,) at places (M, 2), with slopes by place (M, 2) and direction (M,)."""
    count = len(place)
    value, by_place, by_direction = np.empty(count), np.empty((count, 2)), np.empty(count)
    for number in range(count):
        x_m, y_m = place[number, 0], place[number, 1]
        found = log_density_at(grid, slot_idx[number], x_m, y_m, direction[number])
        value[number], by_direction[number] = found.value, found.by_direction
        by_place[number, 0], by_place[number, 1] = found.by_x, found.by_y
    return value, by_place, by_direction


@compiled
def unseen_at_places(grid: Grid, place: Array) -> tuple[Array, Array]:
    """The part (M,) of the ground at places (M, 2) that was not seen, and its slopes (M, 2)."""
    value, by_place = np.empty(len(place)), np.empty((len(place), 2))
    for number in range(len(place)):
        unseen = unseen_at(grid, place[number, 0], place[number, 1])
        value[number] = unseen.value
        by_place[number, 0], by_place[number, 1] = unseen.by_x, unseen.by_y
    return value, by_place


@dataclass(frozen=True, slots=True, kw_only=True)
class PathDensityMap:
    """A log density (S, X, Y, 16) over place (1/m^2) and direction (1/rad) at grid nodes.

    Nodes stand `cell_m` apart from `corner` (2,) on; directions from +X on, evenly; S equal parts
    of the day from midnight UTC on, or one. `elsewhere` is the log density off the grid. `unseen`
    (X, Y) is how much of each node's ground the reference did not see. Were people as many there as
    on the seen ground, `log_level` would be their mean log density and `log_typical` that of a
    person: they heap on paths there, too. `people` (X, Y) is how
    many people's steps made a node: how sure it is.
    """

    corner: Array
    cell_m: float
    log_density: Array
    elsewhere: float
    unseen: Array
    log_level: float
    log_typical: float
    people: Array

    @property
    def slots(self) -> int:
        """The number of parts of the day."""
        return int(self.log_density.shape[0])

    @property
    def undirected(self) -> "PathDensityMap":
        """The map of places alone: at each, all directions are as likely."""
        density = np.exp(self.log_density).mean(axis=3, keepdims=True)
        log_density = np.broadcast_to(np.log(density), self.log_density.shape)
        return replace(self, log_density=log_density)

    def slot_of(self, time_s: Array) -> Index:
        """The part of the day of each time (M,)."""
        return slot_of(time_s, self.slots)

    @property
    def grid(self) -> Grid:
        """The nodes as compiled loops read them."""
        return Grid(
            log_density=np.ascontiguousarray(self.log_density, dtype=np.float64),
            unseen=np.ascontiguousarray(self.unseen, dtype=np.float64),
            corner=np.ascontiguousarray(self.corner, dtype=np.float64),
            nodes_per_m=1 / float(self.cell_m),
            elsewhere=float(self.elsewhere),
        )

    def log_density_at(
        self, place: Array, direction: Array, slot_idx: Index
    ) -> tuple[Array, Array, Array]:
        """Log densities (M,) and their derivatives by place (M, 2) and direction (M,)."""
        return log_densities_at(
            self.grid,
            np.ascontiguousarray(place),
            np.ascontiguousarray(direction),
            np.ascontiguousarray(slot_idx),
        )

    def unseen_at(self, place: Array) -> tuple[Array, Array]:
        """The part (M,) of the ground at places that was not seen, and its slopes (M, 2).

        Outside of the grid both are 0.
        """
        return unseen_at_places(self.grid, np.ascontiguousarray(place))


def slot_of(time_s: Array, slots: int) -> Index:
    """The one of so many equal parts of a UTC day that each time (M,) is in."""
    if slots == 1:
        return np.zeros(time_s.shape, dtype=np.int64)
    return np.floor(time_s % DAY_S / DAY_S * slots).astype(np.int64) % slots


def to_levels(log_density: Array) -> npt.NDArray[np.int16]:
    """Log densities between -500 and 500 as whole numbers, of the same shape."""
    return np.rint(log_density * config.LEVELS).astype(np.int16)


def of_levels(levels: npt.NDArray[np.int16]) -> Array:
    """The log densities of `to_levels`, rounded."""
    return levels.astype(np.float64) / config.LEVELS
