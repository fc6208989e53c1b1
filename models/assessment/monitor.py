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
from models.monitoring.chart import ChartResult, chart_result
from models.monitoring.config import RUN, SLOW_DRIFT_SHARE
from models.monitoring.group_scores import score_groups
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


def chart_of(
    observed: Observed, site: CameraSite, limits: AssessmentLimits, first_idx: int
) -> ChartResult | None:
    """The chart's result of tracks since the operator's last answer, from a change on."""
    rate = AlarmRate(
        alarms_a_year=(1 - SLOW_DRIFT_SHARE) * limits.alarms_a_year,
        tracks_a_year=limits.tracks_a_year,
        calm_ratio=limits.drift.clear_ratio,
        calm_groups=limits.drift.people,
    )
    return alarm_chart_result(
        observed.tracks, site, rate, counted=observed.unanswered, first=first_idx
    )


def alarm_chart_result(
    tracks: Observations,
    site: CameraSite,
    rate: AlarmRate,
    *,
    counted: Mask | None = None,
    first: int = 0,
) -> ChartResult | None:
    """Chart result of tracks from the first one on, or of all where these are too few.

    None of too few tracks, and of a site without paths or a chart.

    Tracks are in the order of their ends; those `counted` (N,) count, all unless it is given. After
    an operator's answer the chart begins anew.

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
