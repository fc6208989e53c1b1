"""Stage 3, estimate: the pose from the newest change on, by speeds, paths, modes and factors."""

import math
from dataclasses import replace

import numpy as np

from models.durations import DAY_S
from models.geometry.rotation import Array
from models.monitoring.chart import ChartResult
from models.monitoring.config import BORNE_OUT
from models.monitoring.drift import LIKELY
from models.pose import config
from models.pose.causes import cause_gains
from models.pose.estimating import PoseFinding, pose_fit_of
from models.pose.power import smallest_told
from models.pose.site import CameraSite
from models.tracks.observations import Observations, of_tracks
from models.walking.config import FEWEST_WALKERS


def since_alarm(
    found: PoseFinding, tracks: Observations, site: CameraSite, chart: ChartResult | None
) -> PoseFinding:
    """The finding of the tracks that a chart alarms about, if these indicate a move.

    Otherwise it is returned as it is. The chart knows how habits differ within its reference and no
    more, so only a tenth of its statistic beyond the level counts as evidence beside the pose.
    """
    if chart is None or not chart.moved or found.posterior.moved >= BORNE_OUT:
        return found
    if found.fused.paths_changed:  # people off all paths are no evidence of the pose
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


def raised_by_slow_drift(moved_prior: float, tracks: Observations, alarms_a_year: float) -> float:
    """The probability of a move after a slow drift was detected and before the pose has its part.

    By how often a stationary camera is reported to drift in so long a window.
    """
    span_s = float(tracks.ended_s[-1] - tracks.ended_s[0]) if tracks.tracks else 0.0
    false = min(max(alarms_a_year * span_s / (365.25 * DAY_S), config.LEAST_FALSE), 1.0)
    return raised(moved_prior, 1 / false)


def detectable_moves(found: PoseFinding, site: CameraSite) -> Array | None:
    """The smallest moves (4, 3) that would be detected; None of a site that is not learned."""
    if not site.learned:
        return None
    people = math.inf if site.paths is None else site.paths.people
    joint = found.joint
    return smallest_told(
        found.fused, joint.walking_groups, joint.walkers, people, found.moved_prior
    )
