"""What tracks say against a site as it was learned: the alarm chart at once, a creep over weeks.

A site's `first` is what it was learned as with its reference: it stays until a person has a new
one made. The map that estimates use grows, by habits alone: what its camera is believed to have
crept by is taken out of the tracks that it grows by. What is left in it by mistake moves nothing
of the first, and so the creep is found (`models.monitoring.creep`).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.durations import DAY_S
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array, Mask
from models.monitoring.chart import ChartResult, chart_result
from models.monitoring.config import BORNE_OUT, RUN
from models.monitoring.creep import CreepLog, add_day, begin_log, posterior_mean_turns
from models.monitoring.group_scores import score_groups
from models.monitoring.verdict import LIKELY
from models.pose import config
from models.pose.causes import cause_gains
from models.pose.estimating import PoseFinding, pose_fit_of
from models.pose.site import CameraSite
from models.simulation.poses import PoseOffset, offset_trajectory
from models.tracks.observations import Observations, of_tracks
from models.tracks.trajectory import Trajectory
from models.walking.config import FEWEST_WALKERS


@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmRate:
    """The false alarms that are allowed in a year, and the tracks that come in one.

    After an alarm the chart has calmed down once `calm_groups` in a row were below `calm_ratio`
    of its level.
    """

    alarms_a_year: float
    tracks_a_year: float
    calm_ratio: float = 0.7
    calm_groups: int = 12


def alarm_chart_result(
    tracks: Observations,
    site: CameraSite,
    rate: AlarmRate,
    *,
    counted: Mask | None = None,
    first: int = 0,
) -> ChartResult | None:
    """Chart result of tracks from the first one on, or else of all; None of too few.

    None, too, of a site without paths or a chart.

    Tracks are in the order of their ends; those `counted` (tracks,) count, all unless it is given.
    Once a person has said that the camera is where it should be, the chart begins anew.

    Raises:
        ShapeError: tracks that are not in the order of their ends.
    """
    if site.paths is None or site.chart is None:
        return None
    usual = site.usual(site.paths, site.chart)
    every = np.arange(tracks.tracks) if counted is None else np.flatnonzero(counted)
    for chosen in (every[every >= first], every):
        if not chosen.size:
            continue
        seen = tracks if chosen.size == tracks.tracks else of_tracks(tracks, chosen)
        scores = score_groups(seen, usual)
        groups_a_year = rate.tracks_a_year * max(scores.last.size, 1) / chosen.size
        reading = chart_result(
            site.chart,
            scores,
            RUN * rate.alarms_a_year / groups_a_year,
            calm_ratio=rate.calm_ratio,
            calm_groups=rate.calm_groups,
        )
        if reading is not None:
            return replace(reading, track_idx=int(chosen[reading.track_idx]))
    return None


def since_alarm(
    found: PoseFinding, tracks: Observations, site: CameraSite, chart: ChartResult | None
) -> PoseFinding:
    """The finding of the tracks that a chart alarms about, where these are of a camera that moved.

    Else it is as it was: the chart knows how people's habits differ within its reference, and no
    more. So of what it says beyond its level, a tenth counts as evidence beside the pose.
    """
    if chart is None or not chart.moved or found.posterior.moved >= BORNE_OUT:
        return found
    if found.fused.paths_changed:  # who walks on none of the paths says nothing of the pose
        return found
    first = max(chart.track_idx, found.first)
    later = of_tracks(tracks, np.arange(first, tracks.tracks))
    if later.walkers < FEWEST_WALKERS:
        return found
    fit = pose_fit_of(later, site)
    odds = math.exp(config.CHART_EVIDENCE * (chart.statistic - chart.level))
    prior = raised(found.moved_prior, odds)
    since = replace(found, joint=fit.joint, fused=fit.fused, first=first, moved_prior=prior)
    if since.posterior.moved < LIKELY or fit.fused.paths_differ:
        return found
    return replace(since, gains=cause_gains(later, site, fit.joint, fit.fused))


def raised(probability: float, odds: float) -> float:
    """A probability after evidence of so many to one."""
    return probability * odds / (probability * odds + 1 - probability)


def raised_by_creep(moved_prior: float, tracks: Observations, alarms_a_year: float) -> float:
    """The probability that a camera moved, after its creep was told and before its pose says more.

    By how often a still camera is told to creep in so long a window.
    """
    span_s = float(tracks.ended_s[-1] - tracks.ended_s[0]) if tracks.tracks else 0.0
    false = min(max(alarms_a_year * span_s / (365.25 * DAY_S), config.LEAST_FALSE), 1.0)
    return raised(moved_prior, 1 / false)


def begin_creep_log(first: CameraSite, to_s: float) -> CreepLog | None:
    """The log of a site as it was first learned, of tracks up to a time; None without a chart."""
    if first.paths is None or first.chart is None:
        return None
    return begin_log(first.chart, to_s)


def log_creep(log: CreepLog, tracks: Observations, first: CameraSite) -> CreepLog:
    """The log with the days of tracks that it does not have yet; these have to be whole days.

    `first` is the site as it was first learned, never grown.

    Raises:
        ShapeError: tracks that are not in the order of their ends.
    """
    if first.paths is None or first.chart is None or not tracks.tracks:
        return log
    usual = first.usual(first.paths, first.chart)
    day_idx = np.floor(tracks.ended_s / DAY_S).astype(np.int64)
    # Each day by itself, so that it matters not which days were at hand together.
    for day in np.setdiff1d(day_idx, log.day_idx):
        scores = score_groups(of_tracks(tracks, np.flatnonzero(day_idx == day)), usual)
        log = add_day(log, first.chart, int(day), scores)
    return log


def without_creep(
    tracks: Sequence[Trajectory],
    intrinsics: Intrinsics,
    prior: CameraPose,
    log: CreepLog,
    from_s: float | None = None,
) -> list[Trajectory | None]:
    """Each track as it would be seen had the camera not crept; None where it would be out of sight.

    Since `from_s` the camera has stood as it does, but for a creep.
    """
    ended_s = np.array([track.time_s[-1] for track in tracks])
    turns = posterior_mean_turns(log, ended_s / DAY_S, from_s)

    def seen(track: Trajectory, turn: Array) -> Trajectory | None:
        if np.abs(turn).max() < config.NO_TURN_RAD:
            return track
        tilt, roll, _, heading = (float(angle) for angle in turn)
        stood = PoseOffset(tilt_rad=tilt, roll_rad=roll, heading_rad=heading).apply(prior)
        return offset_trajectory(track, intrinsics, stood, prior)

    return [seen(track, turn) for track, turn in zip(tracks, turns, strict=True)]
