"""People's habits over a year: day and night, weekends, rain, crowds, seasons; seed in, tracks out.

None of it is the camera's doing, and all of it changes how fast people walk, where, and how many.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.durations import DAY_S, HOUR_S
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array
from models.tracks.trajectory import Trajectory, by_end
from studies.simulation.lanes import Lane, SiteConfig, walk_site

_LANE_MIXES = 10  # lanes stand so often in a list as people take them


@dataclass(frozen=True, slots=True, kw_only=True)
class DayPart:
    """Some hours of a day: the share of its people, and how much faster they walk (log)."""

    hour: float
    share: float
    faster: float


@dataclass(frozen=True, slots=True, kw_only=True)
class HabitConfig:
    """Habits of a site. Numbers of people vary from day to day as a gamma of `evenness`.

    `rain_share` of days are wet, with fewer people who walk faster; on `crowd_share` of evenings
    three times as many come, slowly. A day's own pace has `day_sd` of its log, a year's season
    `season` either way. `mixing` is how alike parts of days are in which lanes are taken.
    """

    parts: tuple[DayPart, ...] = (
        DayPart(hour=2.0, share=0.02, faster=0.03),
        DayPart(hour=8.0, share=0.30, faster=0.02),
        DayPart(hour=13.0, share=0.38, faster=-0.01),
        DayPart(hour=19.0, share=0.30, faster=-0.01),
    )
    evenness: float = 8.0
    weekend_people: float = 0.6
    weekend_faster: float = -0.03
    rain_share: float = 0.2
    rain_people: float = 0.6
    rain_faster: float = 0.04
    crowd_share: float = 0.05
    crowd_people: float = 3.0
    crowd_faster: float = -0.08
    day_sd: float = 0.015
    season: float = 0.015
    mixing: float = 6.0


def walk_days(
    intrinsics: Intrinsics,
    pose: CameraPose,
    lanes: Sequence[Lane],
    config: SiteConfig,
    habits: HabitConfig,
    *,
    tracks_a_day: float,
    days: range,
    rng: np.random.Generator,
    mixes: Array | None = None,
) -> Iterator[list[Trajectory]]:
    """The tracks of each day, in time order; day 0 is a Monday, times are seconds from its start.

    Which lanes are taken when is drawn first, unless the `mixes` of `draw_mixes` are given.

    Raises:
        DegenerateGeometryError: hardly any walk is seen from the pose.
    """
    if mixes is None:
        mixes = draw_mixes(len(lanes), habits, rng)
    for day in days:
        weekend, wet = day % 7 >= 5, rng.uniform() < habits.rain_share
        crowd = rng.uniform() < habits.crowd_share
        people = tracks_a_day * rng.gamma(habits.evenness, 1 / habits.evenness)
        faster = rng.normal(0, habits.day_sd) + habits.season * math.sin(2 * math.pi * day / 365)
        if weekend:
            people, faster = people * habits.weekend_people, faster + habits.weekend_faster
        if wet:
            people, faster = people * habits.rain_people, faster + habits.rain_faster
        tracks: list[Trajectory] = []
        for number, part in enumerate(habits.parts):
            many, pace = people * part.share, faster + part.faster
            if crowd and number == len(habits.parts) - 1:
                many, pace = many * habits.crowd_people, pace + habits.crowd_faster
            count = int(rng.poisson(many))
            taken = _mixed(lanes, mixes[int(weekend), number], rng)
            paced = replace(config, speed_mean_mps=config.speed_mean_mps * math.exp(pace))
            start_s = DAY_S * day + HOUR_S * part.hour
            if not count:
                continue
            tracks += [
                replace(track, time_s=track.time_s + start_s)
                for track in walk_site(intrinsics, pose, taken, paced, count, rng)
            ]
        yield by_end(tracks)


def draw_mixes(lanes: int, habits: HabitConfig, rng: np.random.Generator) -> Array:
    """Lane shares (2, parts, lanes) of people, on weekdays and weekends, by parts of the day."""
    return rng.dirichlet(np.full(lanes, habits.mixing), (2, len(habits.parts)))


def _mixed(lanes: Sequence[Lane], mix: Array, rng: np.random.Generator) -> list[Lane]:
    """Lanes as often as they are taken, in a drawn order."""
    times = np.maximum(np.rint(mix * _LANE_MIXES).astype(int), 1)
    drawn = [lane for lane, number in zip(lanes, times, strict=True) for _ in range(number)]
    return [drawn[number] for number in rng.permutation(len(drawn))]
