"""The control chart: a CUSUM over walking groups, held against what an offset would make of them.

For each of a grid of offsets, of tilt, roll, log height and heading, both ways and in three sizes,
and for times that are too long or too short, the chart knows how the mean score of walking groups
would
change: it has seen the reference's people as a camera so moved would. The statistic is the
largest log likelihood ratio of any offset against none, over the newest 16 to 400 walking groups: a
two-sided CUSUM for each parameter and size (Page 1954) in Lorden's and Lai's window-limited form,
which is the same for one size and keeps its meaning where the reference is itself unsure: its noise
is in the ratio, so that no number of new people makes a reference's own error a drift.
"""

from dataclasses import dataclass

import numpy as np

from models.errors import CheckpointError
from models.geometry.rotation import Array, Index, Mask
from models.monitoring import config
from models.monitoring.group_scores import GroupScores
from models.serialization import Format, flattened, from_bytes, restored, stored_as, to_bytes
from models.walking.speed_reference import SpeedReference

CLOCK = 4  # beside the four of a pose: times that are too long


@dataclass(frozen=True, slots=True, kw_only=True)
class GridOffset:
    """An offset of the grid: of tilt, roll, log height, heading or clock (0 to 4), and how far."""

    parameter: int
    size: float

    @property
    def step(self) -> Array:
        """As a move (4,) of the camera."""
        step = np.zeros(5)
        step[self.parameter] = self.size
        return step[:4]

    @property
    def stretch(self) -> float:
        """Factor by which times are too long."""
        return float(np.exp(self.size)) if self.parameter == CLOCK else 1.0


OFFSET_GRID = tuple(
    GridOffset(parameter=parameter, size=sign * size)
    for parameter, sizes in enumerate(config.OFFSET_SIZES)
    for sign in (1, -1)
    for size in sizes
)


@dataclass(frozen=True, slots=True, kw_only=True)
class DriftChart:
    """Distribution of groups' scores while a camera stands, and their response to each pose offset.

    Scores are bounded around `middle` (14,) by five times their `width` (14,); of these, `mean`
    (14,) and `covariance` (14, 14) are of the `walking_groups` of the reference and `responses`
    (14, K) are what is added to the mean by each offset of the grid. `typical` and `tail` say how
    high the statistic gets in runs of 1000 walking groups: its median, and its mean excess over
    that. `speed_reference` is how people walk by the same tracks; a flow map of these goes with a
    chart.
    """

    speed_reference: SpeedReference = stored_as("paces")
    middle: Array
    width: Array
    mean: Array
    covariance: Array
    responses: Array
    walking_groups: float = stored_as("parties")
    typical: float
    tail: float

    def level(self, alarms_a_run: float) -> float:
        """Level passed so many times by the statistic in 1000 groups of a still camera."""
        share = -np.expm1(-alarms_a_run)
        learned = self.typical + self.tail * max(float(np.log(0.5 / share)), 0.0)
        return max(learned, config.LEAST_LEVEL - float(np.log(share))) * _unsure(
            self.walking_groups, len(self.mean)
        )

    def bounded(self, scores: Array) -> Array:
        """Scores (..., 14) in units of their width, none farther from the middle than 5."""
        return np.clip((scores - self.middle) / self.width, -config.SCORE_BOUND, config.SCORE_BOUND)


@dataclass(frozen=True, slots=True, kw_only=True)
class TestStatistic:
    """A statistic, and the level that it passes as rarely as false alarms are allowed."""

    statistic: float
    level: float

    @property
    def moved(self) -> bool:
        """True where the statistic is beyond its level."""
        return self.statistic > self.level

    @property
    def excess(self) -> float:
        """The statistic in units of its level."""
        return self.statistic / self.level


@dataclass(frozen=True, slots=True, kw_only=True)
class ChartResult(TestStatistic):
    """Chart result of the newest walking groups.

    `statistic` is compared with `level`: where it is below by now, the highest since the chart was
    last calm for some walking groups in a row, so that it matters not after whom somebody looks.
    `parameter` is 0 to 4 as for an offset of the grid, `sign` the way it seems to have gone,
    `walking_groups` how many say so and `track_idx` the first track of theirs. What is `suspicious`
    would be an alarm were a hundred times as many allowed.
    """

    parameter: int
    sign: int
    walking_groups: int
    track_idx: int
    suspicious: bool


def chart_result(
    chart: DriftChart,
    scores: GroupScores,
    alarms_a_run: float,
    *,
    calm_ratio: float,
    calm_groups: int,
    ratios: "Ratios | None" = None,
) -> ChartResult | None:
    """Chart result of the present; None of fewer than 16 walking groups.

    `scores` are of walking groups in the order of their ends: 1000 groups may cause
    `alarms_a_run` false alarms. The chart is calm if it is below `calm_ratio` of its level for
    `calm_groups` in a row. `ratios` are the ratios of the chart, if they are at hand.
    """
    if len(scores.values) < config.FEWEST_GROUPS:
        return None
    most = int(config.LENGTHS[-1])
    newest = chart.bounded(scores.values[-most:])
    path = trace(ratios or ratios_of(chart), newest - chart.mean)
    level = chart.level(alarms_a_run)
    since = _last_calm(path.statistic < calm_ratio * level, calm_groups)
    at = len(newest) - 1
    if path.statistic[at] <= level:
        at = since + int(path.statistic[since:].argmax())
    offset = OFFSET_GRID[int(path.offset_idx[at])]
    walking_groups, statistic = int(path.walking_groups[at]), float(path.statistic[at])
    return ChartResult(
        statistic=statistic,
        level=level,
        parameter=offset.parameter,
        sign=1 if offset.size > 0 else -1,
        walking_groups=walking_groups,
        track_idx=int(scores.last[-most:][at + 1 - walking_groups]),
        suspicious=statistic > chart.level(config.SUSPICION * alarms_a_run),
    )


def _last_calm(calm: Mask, walking_groups: int) -> int:
    """The last place (T,) at which so many, or all so far, were calm; else the first of them."""
    run = 0
    since = 0
    for at, is_calm in enumerate(calm):
        run = run + 1 if is_calm else 0
        if run >= walking_groups or run == at + 1:
            since = at
    return since


@dataclass(frozen=True, slots=True, kw_only=True)
class Ratios:
    """Likelihood ratios of pose offsets: weights (L, 14, K) of mean scores and strengths (L, K)."""

    weights: Array
    strengths: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Trace:
    """The statistic (T,) after each of groups, the offset and the groups that it is of (T,)."""

    statistic: Array
    offset_idx: Index
    walking_groups: Index


def ratios_of(chart: DriftChart) -> Ratios:
    """The weights of a chart for each number of newest walking groups."""
    slopes = np.stack(
        [slope_of(chart, parameter) for parameter in range(len(config.OFFSET_SIZES))], axis=1
    )
    habits = (slopes * config.HABITS) @ (slopes * config.HABITS).T
    weights, strengths = [], []
    for length in config.LENGTHS:
        noise = (
            chart.covariance * (1 / length + config.OTHER_PEOPLE / chart.walking_groups) + habits
        )
        weights.append(np.linalg.solve(noise, chart.responses))
        strengths.append(np.einsum("fk,fk->k", chart.responses, weights[-1]))
    return Ratios(weights=np.array(weights), strengths=np.maximum(strengths, 1e-12))


def trace(ratios: Ratios, apart: Array) -> Trace:
    """The statistic after each of groups, whose scores less the mean are `apart` (T, 14)."""
    count = len(apart)
    sums = np.concatenate([np.zeros((1, apart.shape[1])), np.cumsum(apart, axis=0)])
    statistic = np.full(count, -np.inf)
    offset_idx, walking_groups = np.zeros((2, count), dtype=np.int64)
    for length, weights, strengths in zip(
        config.LENGTHS, ratios.weights, ratios.strengths, strict=True
    ):
        if length > count:
            break
        shown = (sums[length:] - sums[:-length]) @ weights / length
        ratio = _ratio(shown, strengths)
        best = ratio.argmax(axis=1)
        value = ratio[np.arange(len(best)), best]
        own = slice(length - 1, count)
        higher = value > statistic[own]
        statistic[own] = np.where(higher, value, statistic[own])
        offset_idx[own] = np.where(higher, best, offset_idx[own])
        walking_groups[own] = np.where(higher, length, walking_groups[own])
    return Trace(statistic=statistic, offset_idx=offset_idx, walking_groups=walking_groups)


def highest(ratios: Ratios, apart: Array) -> float:
    """The highest statistic of `trace`, in a fraction of its time; -inf of fewer than 16 groups.

    A ratio rises with what is shown, so of all groups the most shown for each offset will do.
    """
    sums = np.concatenate([np.zeros((1, apart.shape[1])), np.cumsum(apart, axis=0)])
    found = -np.inf
    for length, weights, strengths in zip(
        config.LENGTHS, ratios.weights, ratios.strengths, strict=True
    ):
        if length > len(apart):
            break
        shown = (sums[length:] - sums[:-length]) @ weights / length
        found = max(found, float(_ratio(shown.max(axis=0), strengths).max()))
    return found


def _ratio(shown: Array, strengths: Array) -> Array:
    """Log likelihood ratios of offsets (..., K), each as strong as is likeliest in its reach."""
    times = np.asarray(shown / strengths)
    np.maximum(times, 1.0, out=times)
    np.minimum(times, config.STRONGEST, out=times)
    ratio = np.asarray(times * shown)
    times *= times
    times *= strengths
    times /= 2
    ratio -= times
    return ratio


def slope_of(chart: DriftChart, parameter: int) -> Array:
    """The response (14,) to a unit of a parameter, by its smallest offsets both ways."""
    size = config.OFFSET_SIZES[parameter][0]
    on, back = (
        OFFSET_GRID.index(GridOffset(parameter=parameter, size=sign * size)) for sign in (1, -1)
    )
    return np.asarray((chart.responses[:, on] - chart.responses[:, back]) / (2 * size))


def _unsure(walking_groups: float, scores: int) -> float:
    """Factor by which a covariance of so few walking groups makes ratios too large, on average."""
    freedom = walking_groups - 1
    return float(min(freedom / max(freedom - scores - 1, freedom / 3), 3.0))


_CHART = Format(name="chart", version=1)


def chart_to_bytes(chart: DriftChart) -> bytes:
    """A chart as it is stored."""
    return to_bytes(_CHART, flattened(chart))


def chart_from_bytes(data: bytes) -> DriftChart:
    """The chart of `chart_to_bytes`.

    Raises:
        CheckpointError: the bytes are no chart of this format, or of another grid of offsets.
    """
    chart = restored(DriftChart, from_bytes(_CHART, data))
    if chart.responses.shape[1] != len(OFFSET_GRID):
        raise CheckpointError(
            f"responses: {len(OFFSET_GRID)} offsets are needed, got {chart.responses.shape[1]}"
        )
    return chart
