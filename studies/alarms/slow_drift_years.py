"""Simulated cameras that creep, or stand, for months: when the anchor tells it, and how far off."""

import math
from collections.abc import Iterator
from copy import copy, deepcopy
from dataclasses import dataclass
from typing import Self

import numpy as np

from models.assessment import begin_slow_drift_log, log_slow_drift
from models.durations import DAY_S
from models.geometry.pose import CameraPose
from models.monitoring.config import SLOW_DRIFT_SHARE
from models.monitoring.slow_drift import SlowDrift, slow_drift_result
from models.pose import CameraSite, learn_site
from models.simulation.poses import PoseOffset
from models.tracks.trajectory import Trajectory
from studies.simulation.habits import HabitConfig, draw_mixes, walk_days
from studies.simulation.simulated_site import (
    SimulatedSite,
    draw_simulated_site,
    observe_feet,
)

MONTH_DAYS = 365.25 / 12
NUMBERS = {"tilt": 0, "roll": 1, "heading": 3}
_NAMES = {number: name for name, number in NUMBERS.items()}
RATES_DEG = (0.25, 0.5, 1.0)
_FARTHEST_DEG = 5.0
_EVERY_DAYS = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class SlowDriftPlan:
    """Plan of creeping years: traffic, people of the references, and the alarms allowed.

    For how many days they creep at the most, and stand.
    """

    tracks_a_day: float
    reference_tracks: int
    alarms_a_year: float
    days: int
    still_days: int


@dataclass(frozen=True, slots=True, kw_only=True)
class SlowDriftCase:
    """A camera that crept by `rate_deg` a month in a number, or stood, for some `days`.

    `told_deg` is how far it had gone when that was detected, after so many `days`; `said_deg`
    with `said_sd_deg` is what was said then of `said_number`. All are None where it never was.
    `alarms` are all of them; after each the log begins anew, as after a person's answer. `highest`
    is the largest statistic, in units of its level, `groups` made the reference.
    """

    site: int
    seed: int
    number: str
    rate_deg: float
    days: int
    groups: float
    told_deg: float | None
    said_number: str | None
    said_deg: float | None
    said_sd_deg: float | None
    alarms: int
    highest: float

    @property
    def still(self) -> bool:
        """True where the camera stood."""
        return not self.rate_deg


class Life:
    """A camera's site, its first reference, and the people of one day after the other."""

    def __init__(self, site: int, seed: int, plan: SlowDriftPlan) -> None:
        rng = np.random.default_rng([seed, site, 11])
        self.simulated: SimulatedSite = draw_simulated_site(rng)
        self.site, self.seed, self.plan = site, seed, plan
        self._rng = np.random.default_rng(int(rng.integers(2**31)))
        self._mixes = draw_mixes(len(self.simulated.lanes), HabitConfig(), self._rng)
        self.day = -1
        tracks: list[Trajectory] = []
        while len(tracks) < plan.reference_tracks:
            tracks += self.next_day(self.simulated.prior)
        tracks = tracks[: plan.reference_tracks]
        self.reference = tuple(tracks)
        reference = observe_feet(tracks, self.simulated.intrinsics, self.simulated.prior)
        self.to_s = float(tracks[-1].time_s[-1])
        self.first: CameraSite = learn_site(
            reference, self.simulated.intrinsics, self.simulated.prior
        )

    def again(self) -> Self:
        """The same from after the reference on."""
        life = copy(self)
        life._rng = deepcopy(self._rng)
        return life

    def next_day(self, pose: CameraPose) -> list[Trajectory]:
        """The tracks of the next day, seen from a pose."""
        self.day += 1
        days: Iterator[list[Trajectory]] = walk_days(
            self.simulated.intrinsics,
            pose,
            self.simulated.lanes,
            self.simulated.config,
            HabitConfig(),
            tracks_a_day=self.plan.tracks_a_day,
            days=range(self.day, self.day + 1),
            rng=self._rng,
            mixes=self._mixes,
        )
        return next(days)


def slow_drift_cases(site: int, seed: int, plan: SlowDriftPlan) -> list[SlowDriftCase]:
    """One simulated camera that creeps in each number at each rate, and one that stands.

    The same site and seed give the same people before each of them.

    Raises:
        DegenerateGeometryError: no site could be drawn whose people are seen.
    """
    life = Life(site, seed, plan)
    kinds = [(number, rate_deg) for number in NUMBERS for rate_deg in RATES_DEG]
    cases = [
        slow_drift_case(life.again(), number, rate_deg, plan.days) for number, rate_deg in kinds
    ]
    if plan.still_days:
        cases.append(slow_drift_case(life.again(), "tilt", 0.0, plan.still_days))
    return cases


def slow_drift_case(life: Life, number: str, rate_deg: float, most_days: int) -> SlowDriftCase:
    """A camera that creeps, or stands, looked at every third day; until the first alarm of a creep.

    Raises:
        DegenerateGeometryError: nobody is seen any more.
    """
    log = begin_slow_drift_log(life.first, life.to_s)
    assert log is not None
    alarms, highest = 0, 0.0
    from_s: float | None = None
    first: SlowDrift | None = None
    told_deg: float | None = None
    tracks: list[Trajectory] = []
    days = 0
    for days in range(1, most_days + 1):
        turned_deg = rate_deg * days / MONTH_DAYS
        if turned_deg > _FARTHEST_DEG:
            break
        tracks += life.next_day(turned(life.simulated.prior, number, turned_deg))
        if days % _EVERY_DAYS or not tracks:
            continue
        log = log_slow_drift(
            log, observe_feet(tracks, life.simulated.intrinsics, life.simulated.prior), life.first
        )
        tracks = []
        found = slow_drift_result(log, SLOW_DRIFT_SHARE * life.plan.alarms_a_year, from_s)
        if found is None:
            continue
        highest = max(highest, found.excess)
        if found.moved:
            alarms, from_s = alarms + 1, (life.day + 1) * DAY_S
            if first is None:
                first, told_deg = found, turned_deg
            if rate_deg:
                break
    return SlowDriftCase(
        site=life.site,
        seed=life.seed,
        number=number,
        rate_deg=rate_deg,
        days=days,
        groups=log.reference_groups,
        told_deg=told_deg,
        said_number=None if first is None else _NAMES[first.parameter],
        said_deg=None if first is None else math.degrees(first.by),
        said_sd_deg=None if first is None else math.degrees(first.sd),
        alarms=alarms,
        highest=highest,
    )


def turned(pose: CameraPose, number: str, by_deg: float) -> CameraPose:
    """A pose turned in tilt, roll or heading."""
    return PoseOffset(**{f"{number}_rad": math.radians(by_deg)}).apply(pose)
