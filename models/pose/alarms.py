"""The alarm chart of tracks: a camera has moved, long before a pose says how far."""

from dataclasses import dataclass, replace

import numpy as np

from models.geometry.rotation import Mask
from models.monitoring.chart import ChartResult, chart_result
from models.monitoring.config import RUN
from models.monitoring.group_scores import score_groups
from models.pose.site import CameraSite
from models.tracks.observations import Observations, of_tracks


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

    Args:
        tracks: of the window, in the order of their ends.
        site: of the camera.
        rate: of false alarms, which sets the level.
        counted: which tracks (tracks,) count; all unless it is given. Once a person has said that
            the camera is where it should be, the chart begins anew.
        first: the first track after a change.

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
