"""What each day of people says of how a camera stands, held against its first map and speeds.

What is kept of a day is its people's pull on tilt, roll, log height, heading and the log of times:
their scores, weighed by how each of these would change them (the sufficient statistic of a small
move, if scores scatter alike every day).
"""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from models.durations import DAY_S
from models.geometry.rotation import Array
from models.monitoring.chart import HABITS_OF_DAYS, OTHER_PEOPLE, DriftChart, slope_of
from models.monitoring.group_scores import GroupScores

NUMBERS = 5  # tilt, roll, log height, heading, log of times
_BLOCK_DAYS = 7  # weekends walk otherwise
_MOST_BLOCKS = 104
_FEWEST_GROUPS = 60
_SLOW_DAYS = 60.0  # how long a habit of a season lasts
_FREE_RAD = np.radians(60.0)  # one group tells everything at least so badly


@dataclass(frozen=True, slots=True, kw_only=True)
class CreepLog:
    """What days (D,) of people said of how a camera stands, against its first map and speeds.

    `day_idx` counts days from the epoch, `groups` are how many came, `pulls` (D, 5) what they
    add up to. `information` (5, 5) is what a group tells, and `reference_groups` made the chart,
    the last of them on the day `since_day`.
    """

    day_idx: npt.NDArray[np.int64]
    groups: Array
    pulls: Array
    information: Array
    reference_groups: float
    since_day: float


def begin_log(chart: DriftChart, to_s: float) -> CreepLog:
    """The log of a chart whose last people came at a time, without a day."""
    slopes = _slopes(chart)
    return CreepLog(
        day_idx=np.zeros(0, dtype=np.int64),
        groups=np.zeros(0),
        pulls=np.zeros((0, NUMBERS)),
        information=slopes.T @ np.linalg.solve(chart.covariance, slopes),
        reference_groups=chart.walking_groups,
        since_day=to_s / DAY_S,
    )


def add_day(log: CreepLog, chart: DriftChart, day: int, scores: GroupScores) -> CreepLog:
    """The log with a day that it does not know yet, and what its groups say of it.

    Args:
        log: of the same chart.
        chart: the first of the site.
        day: from the epoch.
        scores: of the groups, by the first map and speeds.
    """
    apart = (chart.bounded(scores.values) - chart.mean).sum(axis=0)
    pull = np.linalg.solve(chart.covariance, _slopes(chart)).T @ apart
    at = int(np.searchsorted(log.day_idx, day))
    return replace(
        log,
        day_idx=np.insert(log.day_idx, at, day),
        groups=np.insert(log.groups, at, len(scores.values)),
        pulls=np.insert(log.pulls, at, pull, axis=0),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Weeks:
    """Weeks (B,), each with its people's mean move (B, 5); the newest ends with the last day."""

    groups: Array
    days: Array
    first_day: Array
    middle_day: Array
    moves: Array
    last_day: float


def weeks_of(log: CreepLog, from_s: float | None) -> Weeks | None:
    """The newest weeks since a time, the newest first; None of too few people."""
    from_day = -np.inf if from_s is None else np.ceil(from_s / DAY_S)
    kept = (log.day_idx >= from_day) & (log.groups > 0)
    if log.groups[kept].sum() < _FEWEST_GROUPS:
        return None
    day_idx, groups = log.day_idx[kept], log.groups[kept]
    ago, week = np.unique((day_idx[-1] - day_idx) // _BLOCK_DAYS, return_inverse=True)
    people = np.bincount(week, groups)
    pulls = np.zeros((ago.size, NUMBERS))
    np.add.at(pulls, week, log.pulls[kept])
    first = np.full(ago.size, np.inf)
    np.minimum.at(first, week, day_idx.astype(np.float64))
    newest = slice(0, _MOST_BLOCKS)
    moves = np.linalg.solve(_group_tells(log), (pulls / people[:, None]).T)
    return Weeks(
        groups=np.asarray(people[newest], dtype=np.float64),
        days=np.bincount(week)[newest].astype(np.float64),
        first_day=first[newest],
        middle_day=(np.bincount(week, groups * (day_idx + 0.5)) / people)[newest],
        moves=np.asarray(moves.T[newest], dtype=np.float64),
        last_day=float(day_idx[-1] + 1),
    )


def noise_of(log: CreepLog, weeks: Weeks) -> Array:
    """The covariance (5 B, 5 B) of the weeks' mean moves if the camera stands."""
    person = np.linalg.inv(_group_tells(log))
    apart = np.abs(weeks.middle_day[:, None] - weeks.middle_day)
    people = np.diag(1 / weeks.groups) + OTHER_PEOPLE / log.reference_groups
    habits = np.exp(-apart / _SLOW_DAYS) + np.diag(1 / weeks.days)
    return np.asarray(np.kron(people, person) + np.kron(habits, np.diag(HABITS_OF_DAYS**2)))


def _group_tells(log: CreepLog) -> Array:
    """What a group tells (5, 5), nothing of it so badly that it cannot be inverted."""
    return np.asarray(log.information + np.eye(NUMBERS) / _FREE_RAD**2)


def _slopes(chart: DriftChart) -> Array:
    """How the mean scores (14, 5) change with each number, by its smallest knocks."""
    return np.stack([slope_of(chart, number) for number in range(NUMBERS)], axis=1)
