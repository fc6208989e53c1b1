"""What a site's field of speeds is given room for: as much as its reference asks for.

How freely it may vary is as halves of the people can predict one another. Beside that it has room
for places where people's pace changes abruptly: flights of stairs, foremost.

Ours: a floor at a height z looks, to a camera at a height h, as the ground would where all is
h / (h - z) times as large, however the camera is turned. So stairs and floors need no model of
heights: of the plane they are places with a pace of their own. What a smooth field lacks for them
is room, for a flight is short and people take it at less than half of their pace.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from models.estimation.joint.field import Bumps, Field
from models.estimation.joint.fit import Learned, assumed, held_out_log_likelihood
from models.estimation.joint.hierarchy import reweigh
from models.estimation.joint.measures import Measured, measure_speeds
from models.estimation.joint.observations import Observations, of_tracks
from models.estimation.joint.speed_reference import SpeedReference, learned_at
from models.estimation.parameters import plane_parameters_of
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array
from models.quantiles import SD_OF_MEDIAN_DEVIATION

_FREEDOMS = (0.03, 0.3, 1.0)  # of the field's variation by place and direction, shares of the most
_LEAST_GAIN = 1.0  # of the log likelihood, for a freer field to be worth it
_HALVINGS = 2
_CELL_M = 2.0  # what people walk in a step of 1.5 s
_ABRUPT = 0.2  # of a log speed: twice what a smooth field may vary by
_SD = 0.5  # of a bump
_MOST_BUMPS = 80
_MOVING_MPS = 0.3  # who stands is no evidence of stairs
_FEWEST_IN_CELL, _SIGMAS_IN_CELL = 3, 2.0
_FEWEST_CELLS, _FEWEST_TRACKS, _SIGMAS = 2, 8, 4.5
_ALIKE = 1.5  # of the people's spread: stairs slow all people down, a shop window some
_OWN_SD = 0.1  # of people in one place, before any are seen
_SD_OF_MEDIAN = math.sqrt(math.pi / 2)  # of Gaussian values, over that of their mean
_AROUND = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)])

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


def as_free_as_told(
    observations: Observations, prior: CameraPose, blank: SpeedReference, seed: int
) -> SpeedReference:
    """A blank site whose speeds may vary by place and direction as much as its tracks show.

    One half of the tracks must predict the other: a field that is freer than the site needs costs
    every estimate some of its precision.
    """
    rng = np.random.default_rng(seed)
    halves = []
    for _ in range(_HALVINGS):
        order = rng.permutation(observations.tracks)
        first, second = np.array_split(order, 2)
        halves += [(np.sort(first), np.sort(second)), (np.sort(second), np.sort(first))]
    at = plane_parameters_of(prior)
    # One spread for all, so that they differ in what they predict alone.
    spread = learned_at(observations, prior, blank, 1).speeds.spread
    best, found = -np.inf, blank
    for freedom in _FREEDOMS:
        speeds = assumed(blank.speeds.field.freer(freedom), blank.speeds.spread)
        tried = replace(blank, speeds=speeds, statures=None)
        candidate_site = replace(tried, speeds=replace(tried.speeds, spread=spread))
        log_likelihood = 0.0
        for known, unknown in halves:
            site = learned_at(of_tracks(observations, known), prior, candidate_site, 0)
            log_likelihood += held_out_log_likelihood(
                measure_speeds(of_tracks(observations, unknown).steps, at, prior.heading_rad),
                site.speeds,
            )
        if log_likelihood > best + _LEAST_GAIN * len(halves):
            best, found = log_likelihood, replace(tried, statures=blank.statures)
    return found


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
    field = with_abrupt(blank.speeds.field, bumps)
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
    abrupt = _abrupt_cells(by_cell, deviations)
    if not abrupt:
        return None
    grid = np.unique((np.array(abrupt)[:, None] + _AROUND).reshape(-1, 2), axis=0)
    walked = np.array([tuple(cell) in by_cell for cell in grid.tolist()])
    return Bumps(centres=grid[walked] * _CELL_M, length_m=_CELL_M)


def with_abrupt(field: Field, bumps: Bumps) -> Field:
    """The field with fine bumps beside its smooth ones."""
    count = len(bumps.centres)
    variance = np.full(count, _SD**2 / np.pi)  # squares of bumps one length apart sum to pi
    return replace(
        field,
        abrupt=bumps,
        prior_mean=np.concatenate([field.prior_mean, np.zeros(count)]),
        prior_variance=np.concatenate([field.prior_variance, variance]),
    )


def _rows_by_cell(cells: Rows) -> dict[Cell, Rows]:
    if not len(cells):  # nobody moves
        return {}
    keys, number = np.unique(cells, axis=0, return_inverse=True)
    order = np.argsort(number.ravel(), kind="stable")
    parts = np.split(order, np.cumsum(np.bincount(number.ravel()))[:-1])
    return {(int(x), int(y)): rows for (x, y), rows in zip(keys, parts, strict=True)}


def _abrupt_cells(by_cell: dict[Cell, Rows], deviations: _Deviations) -> list[Cell]:
    """Cells of clusters that are beyond doubt, the surest first, as many as are allowed."""
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
    kept: list[Cell] = []
    for _, cluster in sorted(found, reverse=True):
        if (len(kept) + len(cluster)) * 2 <= _MOST_BUMPS:  # their neighbours are as many again
            kept += cluster
    return kept


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


def _clusters(signs: dict[Cell, bool]) -> Iterable[list[Cell]]:
    """Cells that touch, with the same sign."""
    left = dict(sorted(signs.items()))
    while left:
        cell, sign = left.popitem()
        cluster = [cell]
        for x, y in cluster:  # which grows meanwhile
            for i, j in _AROUND.tolist():
                if left.get((x + i, y + j)) == sign:
                    del left[x + i, y + j]
                    cluster.append((x + i, y + j))
        yield cluster
