"""Results of alarms: false ones of cameras that stand, tracks until those of pose offsets."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from models.simulation.poses import PoseOffset

DAYS = 365.25
_REDRAWN = 4000
_NONE_SEEN = 3.689  # of a Poisson variable that was 0, the 97.5 % limit of its mean
_SEED = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Delay:
    """Tracks until the alarm after a knock of some degrees, a pan or another; inf: never."""

    angle_deg: float
    pan: bool
    tracks: float


@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmResults:
    """One case: false alarms in some camera-years, and delays after knocks.

    `highest` is the largest statistic of the still half as it was recorded, in units of the level,
    `pose_excess` the largest identifiable drift of the pose by that half, in units of its limit.
    """

    name: str
    seed: int
    walking_groups: int
    years: float
    false_alarms: int
    highest: float
    pose_excess: float
    delays: tuple[Delay, ...]


def offsets_of(
    angles_deg: Sequence[float], rng: np.random.Generator
) -> list[tuple[Delay, PoseOffset]]:
    """Offset for each angle in a drawn direction of tilt and roll, and a pan of a drawn sign."""
    found = []
    for angle_deg in angles_deg:
        angle, way = math.radians(angle_deg), rng.uniform(0, 2 * math.pi)
        tilt, roll = angle * math.cos(way), angle * math.sin(way)
        aside = PoseOffset(tilt_rad=tilt, roll_rad=roll, log_height=0.0)
        pan = PoseOffset(
            tilt_rad=0.0, roll_rad=0.0, log_height=0.0, heading_rad=angle * rng.choice([-1.0, 1.0])
        )
        for knock, is_pan in ((aside, False), (pan, True)):
            found.append((Delay(angle_deg=angle_deg, pan=is_pan, tracks=math.inf), knock))
    return found


def share_within(delays: Sequence[Delay], most: float) -> float:
    """The share of delays that ended within so many tracks."""
    return float(np.mean([delay.tracks <= most for delay in delays]))


def by_knock(results: Sequence[AlarmResults]) -> Mapping[tuple[float, bool], list[Delay]]:
    """All delays by angle and kind."""
    found: dict[tuple[float, bool], list[Delay]] = {}
    for result in results:
        for delay in result.delays:
            found.setdefault((delay.angle_deg, delay.pan), []).append(delay)
    return found


def rate_interval(results: Sequence[AlarmResults]) -> tuple[float, float]:
    """False alarms a camera-year, low and high (95 %): cases drawn anew, for cameras differ.

    No alarm in so many years is no proof of none: the high end is at least Poisson's.
    """
    alarms = np.array([result.false_alarms for result in results], dtype=np.float64)
    years = np.array([result.years for result in results])
    drawn = np.random.default_rng(_SEED).integers(0, len(results), (_REDRAWN, len(results)))
    rates = alarms[drawn].sum(axis=1) / years[drawn].sum(axis=1)
    low, high = np.quantile(rates, [0.025, 0.975])
    return float(low), max(float(high), _NONE_SEEN / float(years.sum()))
