"""Other causes than a move: a wrong clock or another focal length, before a camera that stands.

At the prior pose people are asked once more, with all times stretched by a factor, and as a lens of
another focal length would have seen them. Whoever explains speeds and places best has the name.

Ours: the gains in log likelihood along the log of a factor, held against one another as squared
distances of Student's t, as poses are (`models.pose.hypotheses`); of a clock, with d the log of its
factor, v its variance and Q what days differ by in pace, t(d; v + Q + P) / t(d; v + Q).
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from models.geometry.intrinsics import Projection
from models.geometry.pose import array_of
from models.geometry.rotation import Array
from models.monitoring.chart import CLOCK
from models.monitoring.config import HABITS_OF_DAYS
from models.paths.likelihood import Walkers, walkers_of
from models.pose import config
from models.pose.hypotheses import PosePosterior, degrees_of_freedom, log_tail, times_chance
from models.pose.pose_fit import FusedEstimate
from models.pose.site import CameraSite
from models.pose.track_likelihoods import place_log_likelihoods, speed_log_likelihoods
from models.tracks.observations import Observations, Steps
from models.walking.config import FEWEST_GROUPS
from models.walking.estimate import JointEstimate

_STEP = 0.04  # of the log of a factor
CLOCK_LOGS: Array = _STEP * np.arange(-10.0, 11.0)
LENS_LOGS: Array = _STEP * np.arange(-15.0, 16.0)
_NEVER = -1e6  # a gain
_FIRST = 0.06  # asked first, both ways: where neither gains, nothing is wrong


@dataclass(frozen=True, slots=True, kw_only=True)
class Cause:
    """How likely something else than a move is the cause, and the factor by which it is wrong.

    By which all times are too long, or the focal length is longer than is known.
    """

    probability: float
    factor: float


@dataclass(frozen=True, slots=True, kw_only=True)
class CauseGains:
    """Gains in log likelihood over a camera that stands with nothing wrong.

    `clock` is by times that are stretched, along `CLOCK_LOGS`; `lens_speeds` and `lens_places` by a
    focal length that is longer, along `LENS_LOGS`; `pose` by the pose that fits best.
    """

    clock: Array
    lens_speeds: Array
    lens_places: Array
    pose: float


def cause_gains(
    tracks: Observations, site: CameraSite, joint: JointEstimate, fused: FusedEstimate
) -> CauseGains | None:
    """The gains of a window; None where nothing seems wrong, or too little is known to tell.

    A fisheye is asked for its clock alone: another focal length bends its rays otherwise.
    """
    if site.paths is None or fused.paths_changed or joint.walking_groups < FEWEST_GROUPS:
        return None
    prior = array_of(site.prior)
    walkers = walkers_of(tracks, np.append(joint.values, prior[3]))
    speeds, places = _speeds(tracks, site, prior), _places(walkers, site, prior)

    def clock(log: float) -> float:
        steps = replace(tracks.steps, seconds=tracks.steps.seconds * math.exp(log))
        return _speeds(replace(tracks, steps=steps), site, prior) - speeds

    def lens(log: float) -> tuple[float, float]:
        if site.intrinsics.projection == Projection.FISHEYE:
            return _NEVER, 0.0
        zoom = math.exp(log)
        seen = replace(walkers, steps=_zoomed_steps(walkers.steps, zoom))
        lens = replace(site.intrinsics, fx=site.intrinsics.fx * zoom, fy=site.intrinsics.fy * zoom)
        by_speeds = _speeds(_zoomed(tracks, zoom), site, prior) - speeds
        return by_speeds, _places(seen, replace(site, intrinsics=lens), prior) - places

    if max(max(clock(log), sum(lens(log))) for log in (-_FIRST, _FIRST)) < config.CAUSE_GAIN:
        return None
    found = fused.raw if fused.raw is not None else np.append(joint.values, prior[3])
    gains = np.array([lens(log) for log in LENS_LOGS])
    return CauseGains(
        clock=np.array([clock(log) for log in CLOCK_LOGS]),
        lens_speeds=gains[:, 0],
        lens_places=gains[:, 1],
        pose=_speeds(tracks, site, found) + _places(walkers, site, found) - speeds - places,
    )


def likeliest_causes(
    gains: CauseGains, posterior: PosePosterior, walking_groups: int, moved_prior: float
) -> tuple[Cause, Cause]:
    """How likely the clock is wrong, and how likely the lens is another.

    Each is as seldom as a move of the height alone. People of another hour walk elsewhere, and a
    zoom can make up for that: what places say for one counts no more than what speeds do, and
    where speeds alone are better explained by a clock, it is none.
    """
    by_hour = times_chance(walking_groups)
    degrees = degrees_of_freedom(walking_groups)

    def evidence(gain: float) -> float:
        return math.copysign(log_tail(2 * abs(gain) / by_hour, degrees), gain)

    odds = math.log(config.SCALE_SHARE * moved_prior / (1 - moved_prior))
    stands = float(posterior.weights[0])
    moved = math.log(max(1 - stands, 1e-300) / max(stands, 1e-300))
    moved -= log_tail(posterior.prior_squared, degrees)

    lens = gains.lens_speeds + gains.lens_places
    counting = gains.lens_speeds + np.clip(gains.lens_places, None, gains.lens_speeds.clip(0.0))
    by_clock, by_lens = int(gains.clock.argmax()), int(counting.argmax())
    as_clock = float(gains.clock[by_clock])
    beside = evidence(float(counting[by_lens]) - as_clock)
    if gains.lens_speeds[by_lens] < config.LENS_BY_SPEEDS * as_clock:
        beside = -math.inf
    lens_odds = odds + _occam(lens / by_hour, LENS_LOGS, config.LENS_SD)
    clock_odds = odds + _occam(gains.clock / by_hour, CLOCK_LOGS, config.CLOCK_SD)
    return (
        Cause(
            probability=_against(
                odds + _pace_evidence(gains.clock, degrees),
                clock_odds - moved + evidence(as_clock - gains.pose),
                -beside,
            ),
            factor=math.exp(-CLOCK_LOGS[by_clock]),  # what makes up for it, the other way
        ),
        Cause(
            probability=_against(
                lens_odds + evidence(float(counting[by_lens])),
                lens_odds - moved + evidence(float(lens[by_lens]) - gains.pose),
                beside,
            ),
            factor=math.exp(LENS_LOGS[by_lens]),
        ),
    )


def _pace_evidence(gains: Array, degrees: float) -> float:
    """Log odds of a wrong clock, held against days that differ in pace."""
    at = min(max(int(gains.argmax()), 1), gains.size - 2)
    curvature = (2 * gains[at] - gains[at - 1] - gains[at + 1]) / _STEP**2
    right = 1 / max(float(curvature), 1.0) + HABITS_OF_DAYS[CLOCK] ** 2
    wrong, squared = right + config.CLOCK_SD**2, float(CLOCK_LOGS[at]) ** 2
    tails = [log_tail(squared / each, degrees, 1) + math.log(each) / 2 for each in (right, wrong)]
    return float(tails[0] - tails[1])


def _occam(gains: Array, logs: Array, sd: float) -> float:
    """The log share of a prior belief in a factor that is as good as the best, at most 0."""
    width = float(np.exp(gains - gains.max()).sum()) * _STEP
    best = float(logs[gains.argmax()])
    return min(math.log(width / (sd * math.sqrt(2 * math.pi))) - 0.5 * (best / sd) ** 2, 0.0)


def _against(*log_odds: float) -> float:
    """The probability of what has such log odds against each of some others."""
    return 1 / (1 + sum(math.exp(min(max(-each, -700.0), 700.0)) for each in log_odds))


def _speeds(tracks: Observations, site: CameraSite, candidate: Array) -> float:
    return float(speed_log_likelihoods(tracks, site, candidate).sum())


def _places(walkers: Walkers, site: CameraSite, candidate: Array) -> float:
    return float(place_log_likelihoods(walkers, site, candidate[None]).sum())


def _zoomed(tracks: Observations, zoom: float) -> Observations:
    """Tracks as a lens of a focal length so many times as long has seen them."""
    tops = tracks.tops
    return replace(
        tracks,
        steps=_zoomed_steps(tracks.steps, zoom),
        tops=replace(tops, foot_rays=_nearer(tops.foot_rays, zoom), top_y=tops.top_y / zoom),
    )


def _zoomed_steps(steps: Steps, zoom: float) -> Steps:
    return replace(
        steps,
        start_rays=_nearer(steps.start_rays, zoom),
        end_rays=_nearer(steps.end_rays, zoom),
        noisy_end_rays=_nearer(steps.noisy_end_rays, zoom),
    )


def _nearer(rays: Array, zoom: float) -> Array:
    """Rays (M, 3), z = 1, of pixels that are so many times as far from the middle."""
    return np.asarray(rays / [zoom, zoom, 1.0])
