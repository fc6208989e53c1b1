"""Arrival model of a camera's tracks, and the probability that none come for a while.

A profile over the hours of the day, weekends apart, says how many are expected. People come in
walking groups, trains and rushes: gaps between tracks, measured in tracks expected meanwhile, would
be exponential of mean 1 if they came alone; how much longer the longest are is the burst, by which
all expectations are divided. What is left is Poisson given the level of the day, which is Gamma:
usual, or, on a holiday or in the rain, quiet. Times are seconds since the epoch, hours whole ones
since.
"""

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from models.durations import HOUR_S
from models.geometry.rotation import Array
from models.monitoring import config

CELLS = 48  # the hours of a weekday, then those of a day of a weekend
_HOURS_PER_YEAR = 8766.0


class SilenceVerdict(StrEnum):
    """Verdict on a silence."""

    USUAL = "usual"
    IMPROBABLE = "improbable"
    TOO_LONG = "too_long"


@dataclass(frozen=True, slots=True, kw_only=True)
class SilenceRule:
    """So many silences a year may be called improbable though they are none, and none shorter.

    Whatever the arrivals, one longer than `limit_s` in which people should have been seen is.
    """

    false_per_year: float
    least_s: float
    limit_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ArrivalProcess:
    """Arrival process of a camera's tracks: Poisson of walking groups, given the level of the day.

    `rates` are tracks expected in each of the 48 hours, `burst` the tracks that come at once,
    `shape` that of the day's level, `usual_gap_s` what 95 % of the gaps are shorter than, `days`
    the days that it was learned of.
    """

    rates: tuple[float, ...]
    burst: float
    shape: float
    usual_gap_s: float
    days: int

    def __post_init__(self) -> None:
        """Refuse what is no arrival process.

        Raises:
            ValueError: a number is out of its range.
        """
        if len(self.rates) != CELLS or min(self.rates) < 0:
            raise ValueError(f"rates: {CELLS} numbers of at least 0 are needed, got {self.rates}")
        if self.burst < 1 or self.shape <= 0:
            raise ValueError(f"burst, shape: at least 1, above 0, got {self.burst}, {self.shape}")

    @property
    def arrivals_per_year(self) -> float:
        """Walking groups in a year: after each, a silence may begin."""
        week = 5 * sum(self.rates[:24]) + 2 * sum(self.rates[24:])
        return week / (7 * 24) * _HOURS_PER_YEAR / self.burst


def learn_arrivals(
    counts: Array, cells: np.ndarray, known: np.ndarray, first_hour: int, times_s: Array
) -> ArrivalProcess:
    """Arrival process of hours in a row.

    `counts` (H,) are tracks of each hour from `first_hour` since the epoch on, `cells` which of the
    48 hours of a week's profile each is, `known` False during an outage. `times_s` (N,) are when
    the newest tracks ended, in order; they need not reach back as far.
    """
    rates = _rates(counts, cells, known)
    usual = np.diff(times_s)
    return ArrivalProcess(
        rates=tuple(float(rate) for rate in rates),
        burst=_burst(rates[cells], known, first_hour, times_s),
        shape=_shape(counts, rates[cells], known),
        usual_gap_s=float(np.quantile(usual, 0.95)) if len(usual) else math.inf,
        days=math.ceil(float(known.sum()) / 24),
    )


def expected_tracks(
    process: ArrivalProcess, cells: np.ndarray, first_hour: int, from_s: float, to_s: float
) -> float:
    """Expected number of tracks between two times, within the hours of `cells` (H,)."""
    starts_s = HOUR_S * (first_hour + np.arange(len(cells)))
    overlap_s = np.minimum(starts_s + HOUR_S, to_s) - np.maximum(starts_s, from_s)
    rates = np.array(process.rates)[cells]
    return float(rates @ np.clip(overlap_s, 0.0, None)) / HOUR_S


def chance_of_silence(
    process: ArrivalProcess, missed: float, silent_s: float, seen: float, expected: float
) -> float:
    """The probability that a silence is as long as this one, after one more walking group.

    `missed` tracks were expected during it: the longer it is, the more likely is the level another
    one by now. In the hours before it `seen` were, of those `expected`: they tell the level of the
    day.
    """
    missed, seen, expected = (number / process.burst for number in (missed, seen, expected))
    levels = (
        (process.shape, process.shape),
        (config.QUIET_SHAPE, config.QUIET_SHAPE / config.QUIET_LEVEL),
    )
    # Gamma-Poisson: what was seen makes (a, b) into (a + seen, b + expected).
    logs = [
        math.log(share)
        + math.lgamma(a + seen)
        - math.lgamma(a)
        + a * math.log(b)
        - (a + seen) * math.log(b + expected)
        for share, (a, b) in zip((1 - config.QUIET_SHARE, config.QUIET_SHARE), levels, strict=True)
    ]
    weights = [math.exp(value - max(logs)) for value in logs]
    same = [((b + expected) / (b + expected + missed)) ** (a + seen) for a, b in levels]
    other = [(b / (b + missed)) ** a for a, b in levels]
    changed = 1 - (1 - config.CHANGES_PER_HOUR) ** (silent_s / HOUR_S)
    after_change = (1 - config.TURNS_QUIET) * other[0] + config.TURNS_QUIET * other[1]
    unchanged = sum(w * chance for w, chance in zip(weights, same, strict=True)) / sum(weights)
    return float((1 - changed) * unchanged + changed * after_change)


def judge_silence(
    process: ArrivalProcess,
    rule: SilenceRule,
    *,
    missed: float,
    silent_s: float,
    seen: float,
    expected: float,
) -> SilenceVerdict:
    """Verdict on a silence; the arguments are those of `chance_of_silence`."""
    if silent_s < rule.least_s or not is_missed(process, missed):
        return SilenceVerdict.USUAL
    chance = chance_of_silence(process, missed, silent_s, seen, expected)
    if silent_s > rule.limit_s and chance < config.IMPLAUSIBLE:
        return SilenceVerdict.TOO_LONG
    allowed = rule.false_per_year / max(process.arrivals_per_year, 1.0)
    return SilenceVerdict.IMPROBABLE if chance < allowed else SilenceVerdict.USUAL


def is_missed(process: ArrivalProcess, missed: float) -> bool:
    """True where more than a few walking groups should have come: fewer may stay away any day."""
    return missed > config.FEW_GROUPS * process.burst


def delay_of(latest_s: Array) -> float:
    """Longest usual delay of a camera's tracks, in seconds, with a margin.

    Days on which they came far later than on others were those of an outage that was caught up
    with, and do not count.

    `latest_s` (D,) is the longest of each day from a track's end to its being stored; negative
    where a clock is ahead.
    """
    middle = float(np.median(latest_s))
    usual = latest_s[latest_s <= max(4 * middle, middle + 900)]
    delay_s = float(usual.max())
    return delay_s + min(0.5 * max(delay_s, 0.0), 7200.0)


def _rates(counts: Array, cells: np.ndarray, known: np.ndarray) -> Array:
    """Tracks an hour (48,): of each hour of the day, with one more day like the hours beside it."""
    days = np.bincount(cells[known], minlength=CELLS).astype(float)
    sums = np.bincount(cells[known], weights=counts[known], minlength=CELLS)
    apart = (
        days[:24].max() >= config.FEWEST_WEEKDAYS and days[24:].max() >= config.FEWEST_WEEKEND_DAYS
    )
    if not apart:
        days, sums = (np.tile(part[:24] + part[24:], 2) for part in (days, sums))
    rates = np.zeros(CELLS)
    for half in (slice(0, 24), slice(24, 48)):
        mean = sums[half] / np.maximum(days[half], 1)
        beside = (np.roll(mean, 1) + mean + np.roll(mean, -1)) / 3
        rates[half] = (sums[half] + beside) / (days[half] + 1)
    return rates


def _burst(rates: Array, known: np.ndarray, first_hour: int, times_s: Array) -> float:
    """Ratio of the longest gaps to those of people who come alone, in tracks expected meanwhile.

    Source: the time-rescaling theorem (Brown et al., 2002, Neural Computation 14, theorem 1).
    """
    edges = np.concatenate([[0.0], np.cumsum(rates)])
    unseen = np.concatenate([[0], np.cumsum(~known)])
    place = times_s / HOUR_S - first_hour
    place = place[(place >= 0) & (place <= len(rates))]
    rescaled = np.diff(np.interp(place, np.arange(len(edges)), edges))
    rescaled = rescaled[np.diff(unseen[np.minimum(place.astype(int), len(rates))]) == 0]
    found = [
        float(np.quantile(rescaled, share)) / -math.log(1 - share)
        for share in config.TAIL
        if len(rescaled) * (1 - share) >= config.FEWEST_GAPS
    ]
    return max(1.0, *found) if found else config.BURST_UNKNOWN


def _shape(counts: Array, rates: Array, known: np.ndarray) -> float:
    """The shape of the day's level: 1 over its variance, as far as days differ by more than chance.

    Days are 24 hours in a row.
    """
    whole = len(counts) // 24 * 24
    counts, rates = (np.where(known, part, 0.0)[:whole] for part in (counts, rates))
    seen, expected = (part.reshape(-1, 24).sum(axis=1) for part in (counts, rates))
    seen, expected = seen[expected > 0], expected[expected > 0]
    excess = (seen / expected - 1) ** 2 - 1 / expected
    variance = (config.DAY_WEIGHT * config.DAY_VARIANCE + float(excess.sum())) / (
        config.DAY_WEIGHT + len(excess)
    )
    return float(np.clip(1 / max(variance, 1e-6), *config.SHAPES))
