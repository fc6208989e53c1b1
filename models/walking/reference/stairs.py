"""Room in a site's field of speeds for places where everybody's pace changes: flights of stairs.

Ours: a floor at a height z looks, to a camera at a height h, as the ground would where all is
h / (h - z) times as large, however the camera is turned. So stairs and floors need no model of
heights: of the plane they are places with a pace of their own. What a smooth field lacks for them
is room, for a flight is short and people take it at less than half of their pace.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from models.geometry.plane_parameters import plane_parameters_of
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array
from models.quantiles import SD_OF_MEDIAN_DEVIATION
from models.tracks.components import first_of_component
from models.tracks.observations import Observations
from models.walking.field import Bumps
from models.walking.fit import Learned, assumed
from models.walking.measures import Measured, measure_speeds
from models.walking.mixed_model import reweigh
from models.walking.speed_reference import SpeedReference, learned_at

_CELL_M = 2.0  # what people walk in a step of 1.5 s
_ABRUPT = 0.2  # of a log speed: twice what a smooth field may vary by
_SD = 0.5  # of the log speed at a place with fine bumps
_MOST_BUMPS = 80
_MOVING_MPS = 0.3  # who stands is no evidence of stairs
_FEWEST_IN_CELL, _SIGMAS_IN_CELL = 3, 2.0
_FEWEST_CELLS, _FEWEST_TRACKS, _SIGMAS = 2, 8, 4.5
_ALIKE = 1.5  # of the people's spread: stairs slow all people down, a shop window some
_OWN_SD = 0.1  # of people in one place, before any are seen
_SD_OF_MEDIAN = math.sqrt(math.pi / 2)  # of Gaussian values, over that of their mean
_AROUND = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)])
_AHEAD = ((0, 1), (1, -1), (1, 0), (1, 1))  # half of the neighbours: each pair is met once

Cell = tuple[int, int]
Rows = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Deviations:
    """How far rows are off what is usual and off their own track's level (M,), and whose (M,)."""

    value: Array
    owner_idx: Rows

    def of_tracks(self, rows: Rows) -> Array:
        """The mean deviation of each track that has some of the rows, in the tracks' order."""
        _, track = np.unique(self.owner_idx[rows], return_inverse=True)
        return np.asarray(np.bincount(track, self.value[rows]) / np.bincount(track))


def with_room_for_stairs(
    observations: Observations, prior: CameraPose, blank: SpeedReference
) -> SpeedReference:
    """A blank site with fine bumps in its speeds where people's pace changes abruptly."""
    at = plane_parameters_of(prior)
    speeds = learned_at(observations, prior, replace(blank, statures=None), 2).speeds
    measured = measure_speeds(observations.steps, at, prior.heading_rad, sloped=False)
    bumps = abrupt_bumps(measured, speeds)
    if bumps is None:
        return blank
    field = blank.speeds.field.with_abrupt(bumps, _SD)
    return replace(blank, speeds=assumed(field, blank.speeds.spread))


def abrupt_bumps(measured: Measured, learned: Learned) -> Bumps | None:
    """Fine bumps where a field that was learned at the known pose is too smooth; None if nowhere.

    It is so where neighbouring cells differ from it the same way, in both halves of the people.
    """
    residual = measured.value - learned.field.features(measured) @ learned.mean
    residual = np.where(measured.valid, residual, 0.0)
    weights = reweigh(residual, measured.value, measured.valid, measured.rows, learned.spread)
    moving = measured.valid & (measured.value > math.log(_MOVING_MPS))
    owner_idx = measured.rows.owner_idx[moving]
    deviations = _Deviations(
        value=residual[moving] - weights.own[owner_idx, 0], owner_idx=owner_idx
    )
    cells = np.round(measured.place[moving] / _CELL_M).astype(np.int64)
    by_cell = _rows_by_cell(cells)
    found: set[Cell] = set()
    for cluster in _abrupt_clusters(by_cell, deviations):
        more = found | _walked_around(cluster, by_cell)
        if len(more) <= _MOST_BUMPS:
            found = more
    if not found:
        return None
    return Bumps(centres=np.array(sorted(found)) * _CELL_M, length_m=_CELL_M)


def _rows_by_cell(cells: Rows) -> dict[Cell, Rows]:
    if not len(cells):  # nobody moves
        return {}
    keys, number = np.unique(cells, axis=0, return_inverse=True)
    order = np.argsort(number.ravel(), kind="stable")
    parts = np.split(order, np.cumsum(np.bincount(number.ravel()))[:-1])
    return {(int(x), int(y)): rows for (x, y), rows in zip(keys, parts, strict=True)}


def _abrupt_clusters(by_cell: dict[Cell, Rows], deviations: _Deviations) -> list[list[Cell]]:
    """Clusters of cells that are beyond doubt, the surest first."""
    signs: dict[Cell, bool] = {}
    for cell, rows in by_cell.items():
        values = deviations.of_tracks(rows)
        if len(values) >= _FEWEST_IN_CELL and _sigmas(values) > _SIGMAS_IN_CELL:
            signs[cell] = bool(np.median(values) > 0)
    found = []
    for cluster in _clusters(signs):
        values = deviations.of_tracks(np.sort(np.concatenate([by_cell[each] for each in cluster])))
        if len(cluster) < _FEWEST_CELLS or len(values) < _FEWEST_TRACKS:
            continue
        away = values if signs[cluster[0]] else -values
        halves = [float(np.median(half)) for half in np.array_split(away, 2)]
        alike = float(np.median(away)) > _ALIKE * _spread(away)
        if alike and min(halves) > _ABRUPT / 2 and _sigmas(values) > _SIGMAS:
            found.append((_sigmas(values), cluster))
    return [cluster for _, cluster in sorted(found, reverse=True)]


def _sigmas(values: Array) -> float:
    """By how many standard deviations the median is off nought; 0 unless it is abruptly so."""
    middle = float(np.median(values))
    if abs(middle) < _ABRUPT:
        return 0.0
    sd = _SD_OF_MEDIAN * (_spread(values) + _OWN_SD)
    return abs(middle) * math.sqrt(len(values)) / sd


def _spread(values: Array) -> float:
    """The standard deviation of most values."""
    return SD_OF_MEDIAN_DEVIATION * float(np.median(np.abs(values - np.median(values))))


def _clusters(signs: dict[Cell, bool]) -> list[list[Cell]]:
    """Cells that touch, by a side or a corner, with the same sign."""
    number = {cell: n for n, cell in enumerate(signs)}
    touching = [
        (n, number[x + i, y + j])
        for (x, y), n in number.items()
        for i, j in _AHEAD
        if signs.get((x + i, y + j)) == signs[x, y]
    ]
    firsts = first_of_component(np.array(touching, dtype=np.int64).reshape(-1, 2), len(signs))
    clusters: dict[int, list[Cell]] = {}
    for cell, first in zip(signs, firsts.tolist(), strict=True):
        clusters.setdefault(first, []).append(cell)
    return list(clusters.values())


def _walked_around(cluster: list[Cell], by_cell: dict[Cell, Rows]) -> set[Cell]:
    """The cells of a cluster and their neighbours, where people go."""
    around = (np.array(cluster)[:, None] + _AROUND).reshape(-1, 2)
    return by_cell.keys() & {(x, y) for x, y in around.tolist()}
