"""Slow drift: a turn too slow for any window, detected from the daily scores against the first map.

A map that grows follows a slow turn, and no window of some days is long enough to detect it. The
first chart of a site is therefore kept, with the map and the speeds of its reference, and each day
of tracks is scored against it once. From the weeks so far, the test takes the largest standard
score of any turn that grows evenly from some week or from the reference on, or that is constant
since the reference: a generalised likelihood ratio test for a ramp. Three parts of its noise do not
shrink with the number of people. The reference has few people, and the same error on all days.
Habits change where people walk and how fast, slowly by season and from day to day. Height and
walking speed are such habits, so a camera that sinks is not reported.

A day is stored as the sum of its people's scores for tilt, roll, log height, heading and the log of
times, weighted by how each person's tracks would change them (the sufficient statistic of a small
move, if scores have the same spread every day).

The test has its own share of the allowed false alarms. Only a new reference restarts it.

Source: Basseville and Nikiforov, "Detection of Abrupt Changes" (1993), section 7.2.4 for the ratio
test with an unknown start; the ramp in place of a jump is ours.
"""

from dataclasses import dataclass, replace

import numpy as np

from models.durations import DAY_S
from models.geometry.rotation import Array, Index
from models.monitoring import config
from models.monitoring.chart import DriftChart, TestStatistic, slope_of
from models.monitoring.group_scores import GroupScores
from models.quantiles import value_below
from models.serialization import Format, flattened, from_bytes, restored, to_bytes

NUMBERS = 5  # tilt, roll, log height, heading, log of times


@dataclass(frozen=True, slots=True, kw_only=True)
class SlowDriftLog:
    """Sums of the scores of days (D,) of people, against the first map and speeds of a reference.

    `day_idx` counts days from the epoch, `groups` are how many came, `pulls` (D, 5) what they
    add up to. `information` (5, 5) is that of a group, and `reference_groups` made the chart,
    the last of them on the day `since_day`.
    """

    day_idx: Index
    groups: Array
    pulls: Array
    information: Array
    reference_groups: float
    since_day: float


def begin_log(chart: DriftChart, to_s: float) -> SlowDriftLog:
    """The log of a chart whose last people came at a time, without a day."""
    slopes = _slopes(chart)
    return SlowDriftLog(
        day_idx=np.zeros(0, dtype=np.int64),
        groups=np.zeros(0),
        pulls=np.zeros((0, NUMBERS)),
        information=slopes.T @ np.linalg.solve(chart.covariance, slopes),
        reference_groups=chart.walking_groups,
        since_day=to_s / DAY_S,
    )


def add_day(log: SlowDriftLog, chart: DriftChart, day: int, scores: GroupScores) -> SlowDriftLog:
    """The log with a day that it does not know yet, and what its groups say of it.

    Scores are by the first map and speeds of the site.
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


def weeks_of(log: SlowDriftLog, from_s: float | None) -> Weeks | None:
    """The newest weeks since a time, the newest first; None of too few people."""
    from_day = -np.inf if from_s is None else np.ceil(from_s / DAY_S)
    kept = (log.day_idx >= from_day) & (log.groups > 0)
    if log.groups[kept].sum() < config.FEWEST_LOGGED:
        return None
    day_idx, groups = log.day_idx[kept], log.groups[kept]
    ago, week = np.unique((day_idx[-1] - day_idx) // config.BLOCK_DAYS, return_inverse=True)
    people = np.bincount(week, groups)
    pulls = np.zeros((ago.size, NUMBERS))
    np.add.at(pulls, week, log.pulls[kept])
    first = np.full(ago.size, np.inf)
    np.minimum.at(first, week, day_idx.astype(np.float64))
    newest = slice(0, config.MOST_BLOCKS)
    moves = np.linalg.solve(_group_information(log), (pulls / people[:, None]).T)
    return Weeks(
        groups=np.asarray(people[newest], dtype=np.float64),
        days=np.bincount(week)[newest].astype(np.float64),
        first_day=first[newest],
        middle_day=(np.bincount(week, groups * (day_idx + 0.5)) / people)[newest],
        moves=np.asarray(moves.T[newest], dtype=np.float64),
        last_day=float(day_idx[-1] + 1),
    )


def noise_of(log: SlowDriftLog, weeks: Weeks) -> Array:
    """The covariance (5 B, 5 B) of the weeks' mean moves if the camera stands."""
    person = np.linalg.inv(_group_information(log))
    apart = np.abs(weeks.middle_day[:, None] - weeks.middle_day)
    people = np.diag(1 / weeks.groups) + config.OTHER_PEOPLE / log.reference_groups
    habits = np.exp(-apart / config.SEASON_DAYS) + np.diag(1 / weeks.days)
    return np.asarray(np.kron(people, person) + np.kron(habits, np.diag(config.HABITS_OF_DAYS**2)))


def _group_information(log: SlowDriftLog) -> Array:
    """Information of a group (5, 5), none of it so small that it cannot be inverted."""
    return np.asarray(log.information + np.eye(NUMBERS) / config.FREE_RAD**2)


def _slopes(chart: DriftChart) -> Array:
    """Change of the mean scores (14, 5) with each parameter, by its smallest offsets."""
    return np.stack([slope_of(chart, number) for number in range(NUMBERS)], axis=1)


ANGLES = (0, 1, 3)  # only tilt, roll and heading drift slowly


@dataclass(frozen=True, slots=True, kw_only=True)
class SlowDrift(TestStatistic):
    """Most likely slow drift of a camera: its turn so far.

    `statistic` is compared with `level`. `parameter` is 0 for tilt, 1 for roll, 3 for heading, `by`
    how far it has gone (radians) with the standard deviation `sd`, since the day `since_day`.
    """

    parameter: int
    by: float
    sd: float
    since_day: float


def slow_drift_result(
    log: SlowDriftLog, alarms_a_year: float, from_s: float | None = None
) -> SlowDrift | None:
    """Most likely slow drift from a log's newest weeks; None if it has too few people or days.

    `alarms_a_year` are allowed for slow drift alone. Since `from_s` the camera has moved only by
    slow drift; only whole days count.
    """
    scores = ramp_scores(log, from_s)
    if scores is None or not scores.information.all():
        return None  # the afternoon of the reference's own day is all there is: no ramp has begun
    chance = min(alarms_a_year / config.SLOW_DRIFT_TESTS, 0.5) / 2
    level = value_below(chance, max(log.reference_groups - 1, 1.0)) ** 2
    statistics = scores.score**2 / scores.information
    row, way = np.unravel_index(int(statistics.argmax()), statistics.shape)
    return SlowDrift(
        statistic=float(statistics[row, way]),
        level=level,
        parameter=ANGLES[int(row)],
        by=float(scores.score[row, way] / scores.information[row, way]),
        sd=float(scores.information[row, way] ** -0.5),
        since_day=float(scores.ramps.starts[way]),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Ramps:
    """Ways (W,) to turn by one up to the day `now`: evenly from a day `starts` (W,) on, or at once.

    The first is the one at once.
    """

    starts: Array
    now: float

    def at(self, days: Array) -> Array:
        """Size (W, N) of each ramp on some days (N,)."""
        turned = np.maximum(days - self.starts[:, None], 0.0)
        turned = turned / np.maximum(self.now - self.starts, 1e-9)[:, None]
        turned[0] = 1.0
        return np.asarray(turned)


@dataclass(frozen=True, slots=True, kw_only=True)
class RampScores:
    """Scores of weeks along ramps of turns (3, W) of tilt, roll, heading, and their weights.

    A turn's likeliest size is `score / information`, with a variance of `1 / information`.
    """

    ramps: Ramps
    score: Array
    information: Array


def ramp_scores(log: SlowDriftLog, from_s: float | None) -> RampScores | None:
    """Scores of a log's weeks along every ramp; None of too few people."""
    weeks = weeks_of(log, from_s)
    if weeks is None:
        return None
    later = weeks.first_day[weeks.first_day > log.since_day]
    ramps = Ramps(starts=np.array([log.since_day, log.since_day, *later]), now=weeks.last_day)
    ways = ramps.at(weeks.middle_day)
    weighed = np.linalg.inv(noise_of(log, weeks))
    pull = (weighed @ weeks.moves.ravel()).reshape(-1, NUMBERS)
    return RampScores(
        ramps=ramps,
        score=np.array([ways @ pull[:, number] for number in ANGLES]),
        information=np.array(
            [
                np.einsum("wb,bc,wc->w", ways, weighed[number::NUMBERS, number::NUMBERS], ways)
                for number in ANGLES
            ]
        ),
    )


def posterior_mean_turns(log: SlowDriftLog, days: Array, from_s: float | None = None) -> Array:
    """Posterior mean (N, 4) of a camera's turn in tilt, roll, log height, heading by days (N,).

    The camera is stationary, or drifts along one of the ramps by about half a degree a month. Each
    case is weighted by its marginal likelihood and by the share of cameras that drift slowly.
    Tracks of a stationary camera are therefore not bent to the noise of its first map. 0 if the
    log has too few people. `from_s` as in `slow_drift_result`.

    Source: Bayesian model averaging; the ratio of the marginal likelihoods of a Gaussian's mean.
    """
    turns = np.zeros((len(days), 4))
    scores = ramp_scores(log, from_s)
    if scores is None:
        return turns
    months = np.maximum(scores.ramps.now - scores.ramps.starts, 1.0) / config.SLOW_DRIFT_DAYS
    usual = (config.SLOW_DRIFT_RAD * months) ** 2
    size = usual * scores.score / (1 + usual * scores.information)
    ratio = 0.5 * (size * scores.score - np.log1p(usual * scores.information))
    odds = (
        config.SLOW_DRIFT_PRIOR
        / (1 - config.SLOW_DRIFT_PRIOR)
        / ratio.size
        * np.exp(np.clip(ratio, -50.0, 50.0))
    )
    probability = odds / (1 + odds.sum())
    turns[:, ANGLES] = ((probability * size) @ scores.ramps.at(np.asarray(days))).T
    return turns


_SLOW_DRIFT_LOG = Format(name="creep", version=1)


def slow_drift_log_to_bytes(log: SlowDriftLog) -> bytes:
    """A log as it is stored."""
    return to_bytes(_SLOW_DRIFT_LOG, flattened(log))


def slow_drift_log_from_bytes(data: bytes) -> SlowDriftLog:
    """The log of `slow_drift_log_to_bytes`.

    Raises:
        CheckpointError: the bytes are no log of this format.
    """
    return restored(SlowDriftLog, from_bytes(_SLOW_DRIFT_LOG, data))
