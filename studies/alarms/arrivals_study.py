"""Simulated years of people before a camera: false alerts of silence, and how long real ones take.

Places differ in their hours, flows, walking groups, rain, holidays, seasons and in how their tracks
are posted; some are stations, where people come by the train.

    python -m studies arrivals --years 50
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.durations import DAY_S, HOUR_S
from models.geometry.rotation import Array
from models.monitoring.arrivals import (
    ArrivalProcess,
    SilenceRule,
    SilenceVerdict,
    delay_of,
    expected_tracks,
    judge_silence,
    learn_arrivals,
)

RULE = SilenceRule(false_per_year=1.0, least_s=600.0, limit_s=DAY_S)
_PAST_DAYS, _FIRST_DAYS = 28, 7
_DAYS = _FIRST_DAYS + 365
_LOOK_BACK_S = 3 * HOUR_S
_HOURS = np.arange(24)
_KINDS = ("commuters", "shops", "promenade", "evenings", "station")
_POSTS = ("live", "hourly", "nightly", "stalling")


@dataclass(frozen=True, slots=True, kw_only=True)
class YearResult:
    """A camera-year: false alerts, and hours from outages at noon on busy days to their alerts.

    An outage that was not noticed within its limit is infinite.
    """

    kind: str
    posts: str
    noon_tracks: float
    false_alerts: int
    noticed_h: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Year:
    """Times at which tracks ended, in order, and at which each was stored."""

    ended_s: Array
    received_s: Array
    quiet_days: np.ndarray


def study_rhythm(years: int, seed: int) -> tuple[YearResult, ...]:
    """So many simulated camera-years."""
    return tuple(_study_year(np.random.default_rng([seed, n])) for n in range(years))


def _study_year(rng: np.random.Generator) -> YearResult:
    kind = _KINDS[rng.choice(len(_KINDS), p=(0.3, 0.3, 0.15, 0.15, 0.1))]
    posts = _POSTS[rng.choice(len(_POSTS), p=(0.4, 0.3, 0.15, 0.15))]
    noon = float(np.exp(rng.uniform(np.log(5), np.log(120))))
    year = _simulate(rng, kind, posts, noon)
    cells = np.tile(_HOURS, _DAYS) + 24 * np.repeat(np.arange(_DAYS) % 7 >= 5, 24)
    false_alerts, noticed_h = 0, []
    outage_days = rng.choice(np.arange(_FIRST_DAYS, _DAYS - 3), 12, replace=False)
    for day in range(_FIRST_DAYS, _DAYS):
        process, delay_s = _learned(year, cells, day)
        false_alerts += _false_alerts(year, cells, process, delay_s, day)
        if day in outage_days and day % 7 < 5 and not year.quiet_days[day]:
            noticed_h.append(_noticed_h(year, cells, process, delay_s, (day + 0.5) * DAY_S))
    return YearResult(
        kind=kind,
        posts=posts,
        noon_tracks=noon,
        false_alerts=false_alerts,
        noticed_h=tuple(noticed_h),
    )


def _learned(year: _Year, cells: np.ndarray, day: int) -> tuple[ArrivalProcess, float]:
    """Arrival model and delay that are known at a day's beginning."""
    now_s, first_day = day * DAY_S, max(day - _PAST_DAYS, 0)
    stored = (year.received_s <= now_s) & (year.received_s > first_day * DAY_S)
    ended_s = year.ended_s[stored]
    first, last = 24 * first_day, int(ended_s.max() // HOUR_S)
    counts = np.bincount((ended_s // HOUR_S).astype(int), minlength=last + 1)[first:last]
    known = np.ones(len(counts), dtype=bool)
    process = learn_arrivals(counts.astype(float), cells[first:last], known, first, ended_s)
    lags_s, days = (
        year.received_s[stored] - ended_s,
        (year.received_s[stored] // DAY_S).astype(int),
    )
    latest = np.full(day + 1, -np.inf)
    np.maximum.at(latest, days, lags_s)
    return process, delay_of(latest[np.isfinite(latest)])


def _false_alerts(
    year: _Year, cells: np.ndarray, process: ArrivalProcess, delay_s: float, day: int
) -> int:
    """Alerts about the silences that end on a day; the longest moment of each is its last."""
    begin, end = np.searchsorted(year.received_s, [day * DAY_S, (day + 1) * DAY_S])
    ends_s = np.maximum.accumulate(year.ended_s[: end + 1])[max(begin - 1, 0) :]
    received_s = year.received_s[max(begin - 1, 0) : end + 1]
    silent_s = np.minimum(received_s[1:] - delay_s - ends_s[:-1], np.diff(received_s))
    return sum(
        _alerts(year, cells, process, ends_s[n], received_s[n + 1] - delay_s, silent_s[n])
        for n in np.flatnonzero(silent_s >= RULE.least_s)
    )


def _noticed_h(
    year: _Year, cells: np.ndarray, process: ArrivalProcess, delay_s: float, at_s: float
) -> float:
    """Hours of nothing from a time on until that is an alert; what was seen is posted."""
    last_s = year.ended_s[np.searchsorted(year.ended_s, at_s) - 1]
    for minutes in range(1, 60 * 60):
        until_s = at_s + 60 * minutes - delay_s
        if _alerts(year, cells, process, last_s, until_s, until_s - last_s):
            return minutes / 60
    return np.inf


def _alerts(
    year: _Year,
    cells: np.ndarray,
    process: ArrivalProcess,
    last_s: float,
    until_s: float,
    silent_s: float,
) -> bool:
    before = np.searchsorted(year.ended_s, [last_s - _LOOK_BACK_S, last_s], side="right")
    verdict = judge_silence(
        process,
        RULE,
        missed=_expected(process, cells, last_s, until_s),
        silent_s=silent_s,
        seen=float(np.diff(before)[0]),
        expected=_expected(process, cells, last_s - _LOOK_BACK_S, last_s),
    )
    return verdict is not SilenceVerdict.USUAL


def _expected(process: ArrivalProcess, cells: np.ndarray, from_s: float, to_s: float) -> float:
    first, last = max(int(from_s // HOUR_S), 0), int(to_s // HOUR_S) + 1
    return expected_tracks(process, cells[first:last], first, from_s, to_s)


def _simulate(rng: np.random.Generator, kind: str, posts: str, noon: float) -> _Year:
    weekend = np.arange(_DAYS) % 7 >= 5
    hours = np.where(weekend[:, None], _profile(kind, True), _profile(kind, False)) * noon
    season = 1 + 0.3 * np.sin(2 * np.pi * (np.arange(_DAYS) / 365 + rng.random()))
    level = season * rng.gamma(12, 1 / 12, _DAYS)
    quiet = rng.random(_DAYS) < 10 / 365
    level = np.where(quiet, level * rng.uniform(0.1, 0.5, _DAYS), level)
    rain = np.ones((_DAYS, 24))
    for day in np.flatnonzero(rng.random(_DAYS) < 0.3):
        begins, lasts = rng.integers(0, 24), rng.integers(1, 9)
        rain[day, begins : begins + lasts] = rng.uniform(0.15, 0.8)
    rates = (hours * level[:, None] * rain).ravel()
    if kind == "station":
        # Of ten in a train nobody is alone; trains go every 20 minutes, as the timetable has it.
        trains_s = 1200.0 * np.arange(3 * 24 * _DAYS) + 60 * rng.normal(0, 1, 3 * 24 * _DAYS)
        crowd = rng.poisson(np.repeat(rates / 3, 3))
        ended_s = np.repeat(trains_s + 300, crowd) + rng.exponential(60, crowd.sum())
    else:
        walking_groups = rng.poisson(rates / 1.6)
        starts_s = np.repeat(HOUR_S * np.arange(len(rates)), walking_groups)
        starts_s = starts_s + HOUR_S * rng.random(len(starts_s))
        sizes = 1 + rng.poisson(0.6, len(starts_s))
        ended_s = np.repeat(starts_s, sizes) + rng.exponential(3, sizes.sum())
    ended_s = np.sort(ended_s[(ended_s > 0) & (ended_s < _DAYS * DAY_S)])
    return _Year(ended_s=ended_s, received_s=_received(rng, posts, ended_s), quiet_days=quiet)


def _profile(kind: str, weekend: bool) -> Array:
    """People of each hour (24,) against noon of a weekday."""

    def around(hour: float, width: float) -> Array:
        return np.asarray(np.exp(-(((_HOURS + 0.5 - hour) / width) ** 2)))

    night = 0.003
    if kind in ("commuters", "station"):
        rush = 1.5 * around(8, 1.2) + 1.5 * around(17.5, 1.8) + around(12.5, 2.5)
        return (0.3 * around(14, 4) if weekend else rush) + night
    if kind == "shops":
        return (1.3 if weekend else 1.0) * around(14, 4) + night
    if kind == "promenade":
        return (2.5 if weekend else 1.0) * around(14.5, 4) + night
    return around(13, 2) + (2.0 if weekend else 1.0) * around(21, 3) + 0.01


def _received(rng: np.random.Generator, posts: str, ended_s: Array) -> Array:
    """Times at which each track is stored, in order, by how they are posted."""
    live_s = ended_s + rng.exponential(2, len(ended_s))
    if posts == "hourly":
        late_s = rng.exponential(90, _DAYS * 24 + 2)
        slots = np.ceil(ended_s / HOUR_S).astype(int)
        live_s = HOUR_S * slots + late_s[slots]
    elif posts == "nightly":
        late_s = 2 * HOUR_S + rng.exponential(900, _DAYS + 2)
        slots = np.ceil(ended_s / DAY_S).astype(int)
        live_s = DAY_S * slots + late_s[slots]
    elif posts == "stalling":
        for begins_s in rng.uniform(0, _DAYS * DAY_S, rng.poisson(_DAYS / 30)):
            ends_s = begins_s + rng.uniform(60, 900)
            live_s = np.where((live_s > begins_s) & (live_s < ends_s), ends_s, live_s)
    return np.maximum.accumulate(live_s)


def describe(results: Sequence[YearResult]) -> str:
    """The figures in words, one line each."""
    false = np.array([result.false_alerts for result in results])
    lines = [
        f"{len(results)} camera-years: {false.sum()} false alerts, {false.mean():.2f} in each "
        f"(set: {RULE.false_per_year:g}); {np.mean(false == 0):.0%} of the years without any"
    ]
    for name, key in (("kind", "kind"), ("posts", "posts")):
        for value in sorted({getattr(result, key) for result in results}):
            some = [result.false_alerts for result in results if getattr(result, key) == value]
            lines.append(f"  {name} {value}: {np.mean(some):.2f} in {len(some)} years")
    for low, high in ((5, 15), (15, 40), (40, 120)):
        found = [
            hours
            for result in results
            if low <= result.noon_tracks < high and result.posts in ("live", "stalling")
            for hours in result.noticed_h
        ]
        if found:
            middle, late = np.quantile(found, [0.5, 0.9], method="higher")
            lines.append(
                f"outage at noon, {low} to {high} tracks an hour, posted live: "
                f"noticed after {middle:.1f} h (90 %: {late:.1f} h), {len(found)} outages"
            )
    return "\n".join(lines)


def main(arguments: Sequence[str]) -> None:
    """Print what simulated years come to."""
    parser = argparse.ArgumentParser("studies arrivals", description=__doc__)
    parser.add_argument("--years", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args(arguments)
    sys.stdout.write(describe(study_rhythm(given.years, given.seed)) + "\n")
