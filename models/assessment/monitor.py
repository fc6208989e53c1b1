"""Stage 2, monitor: the drift chart of a window, and the slow drift of weeks.

The chart compares the scores of walking groups with the reference at once. The slow drift compares
whole days with the first map and chart of the reference, which never grow (`slow_drift`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.assessment.values import AssessmentLimits, Observed
from models.durations import DAY_S
from models.geometry.rotation import Mask
from models.monitoring.chart import ChartResult, DriftChart, Ratios, chart_result
from models.monitoring.config import RUN, SLOW_DRIFT_SHARE
from models.monitoring.group_scores import GroupScores, TrackScores, score_tracks
from models.monitoring.slow_drift import SlowDrift, slow_drift_result
from models.pose.site import CameraSite
from models.tracks.observations import Observations, of_tracks
from models.tracks.trajectory import Trajectory

_YEAR_S = 365.25 * DAY_S


@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmRate:
    """False alarms allowed in a year, and the tracks that come in one.

    After an alarm the chart has calmed down once `calm_groups` in a row were below `calm_ratio`
    of its level.
    """

    alarms_a_year: float
    tracks_a_year: float
    calm_ratio: float = 0.7
    calm_groups: int = 12


def tracks_a_year(tracks: Sequence[Trajectory]) -> float:
    """The tracks that come in a year at the rate of some, which are in the order of their ends.

    A recording of less than a day counts as a whole day.
    """
    span_s = float(tracks[-1].time_s[-1] - tracks[0].time_s[-1]) if tracks else 0.0
    return max(len(tracks), 1) * _YEAR_S / max(span_s, DAY_S)


def slow_drift_of(site: CameraSite, alarms_a_year: float) -> SlowDrift | None:
    """Slow drift by its share of the allowed false alarms; None of a site without whole days."""
    baseline = site.baseline
    if baseline is None or baseline.days is None:
        return None
    return slow_drift_result(baseline.days, SLOW_DRIFT_SHARE * alarms_a_year, baseline.from_s)


def alarm_rate_of(limits: AssessmentLimits) -> AlarmRate:
    """False alarms that the chart may raise by the limits of an assessment."""
    return AlarmRate(
        alarms_a_year=(1 - SLOW_DRIFT_SHARE) * limits.alarms_a_year,
        tracks_a_year=limits.tracks_a_year,
        calm_ratio=limits.drift.clear_ratio,
        calm_groups=limits.drift.people,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Charted:
    """Chart result of tracks, and their scores; the result is None of too few walking groups."""

    result: ChartResult | None
    scores: TrackScores


def chart_of(
    observed: Observed, site: CameraSite, limits: AssessmentLimits, first_idx: int
) -> Charted | None:
    """Chart of tracks since the operator's last answer, from a change on."""
    rate = alarm_rate_of(limits)
    return alarm_chart(observed.tracks, site, rate, counted=observed.unanswered, first=first_idx)


def alarm_chart_result(
    tracks: Observations,
    site: CameraSite,
    rate: AlarmRate,
    *,
    counted: Mask | None = None,
    first: int = 0,
) -> ChartResult | None:
    """Result of `alarm_chart`; None of too few tracks, too."""
    charted = alarm_chart(tracks, site, rate, counted=counted, first=first)
    return None if charted is None else charted.result


def alarm_chart(
    tracks: Observations,
    site: CameraSite,
    rate: AlarmRate,
    *,
    counted: Mask | None = None,
    first: int = 0,
) -> Charted | None:
    """Chart of tracks from the first one on, or of all if these are too few.

    None of no tracks, and of a site without paths or a chart.

    Tracks are in the order of their ends; the `counted` (N,) ones count, all unless it is given.
    After an operator's answer the chart starts anew.

    Raises:
        ShapeError: tracks that are not in the order of their ends.
    """
    charted = None
    if site.paths is None or site.chart is None:
        return None
    usual = site.usual(site.paths, site.chart)
    every = np.arange(tracks.tracks) if counted is None else np.flatnonzero(counted)
    for chosen in (every[every >= first], every):
        if not chosen.size:
            continue
        seen = tracks if chosen.size == tracks.tracks else of_tracks(tracks, chosen)
        scores = score_tracks(seen, usual)
        result = result_of_groups(site.chart, scores.groups, rate, int(chosen.size))
        if result is not None:
            result = replace(result, track_idx=int(chosen[result.track_idx]))
        charted = Charted(result=result, scores=replace(scores, people=chosen[scores.people]))
        if result is not None:
            break
    return charted


def result_of_groups(
    chart: DriftChart,
    groups: GroupScores,
    rate: AlarmRate,
    tracks: int,
    ratios: Ratios | None = None,
) -> ChartResult | None:
    """Chart result of the walking groups among so many tracks; None of too few."""
    groups_a_year = rate.tracks_a_year * max(groups.last.size, 1) / tracks
    return chart_result(
        chart,
        groups,
        RUN * rate.alarms_a_year / groups_a_year,
        calm_ratio=rate.calm_ratio,
        calm_groups=rate.calm_groups,
        ratios=ratios,
    )
