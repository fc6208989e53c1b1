"""A drift chart that watches a camera, as the service learns and asks it."""

import math
from dataclasses import dataclass

import numpy as np

from models.geometry.rotation import Array
from models.monitoring.chart import DriftChart, Ratios, ratios_of, trace
from models.monitoring.config import RUN
from models.monitoring.group_scores import GroupScores, Usual
from models.pose import CameraSite
from studies.alarms.results import DAYS

_MOST_ALARMS = 50


@dataclass(frozen=True, slots=True, kw_only=True)
class Watch:
    """A chart that watches a camera, at the level of a rate of false alarms."""

    chart: DriftChart
    usual: Usual
    ratios: Ratios
    level: float

    def apart(self, scores: GroupScores) -> Array:
        """Differences of walking groups (P, 14) from what is usual."""
        return self.chart.bounded(scores.values) - self.chart.mean

    def alarms(self, apart: Array) -> list[int]:
        """After which of groups (P, 14) there was an alarm; the chart begins anew after each."""
        found: list[int] = []
        while len(found) < _MOST_ALARMS:
            first = found[-1] if found else 0
            beyond = np.flatnonzero(trace(self.ratios, apart[first:]).statistic > self.level)
            if not beyond.size:
                break
            found.append(first + int(beyond[0]) + 1)
        return found


def watch_over(site: CameraSite, *, alarms_a_year: float, groups_a_day: float) -> Watch | None:
    """The chart of a learned site at a level; None where too few people walked to learn one."""
    if site.paths is None or site.chart is None:
        return None
    return Watch(
        chart=site.chart,
        usual=site.usual(site.paths, site.chart),
        ratios=ratios_of(site.chart),
        level=site.chart.level(RUN * alarms_a_year / (groups_a_day * DAYS)),
    )


def first_alarm(watch: Watch, apart: Array, tracks_a_group: float) -> float:
    """Tracks until the first alarm among walking groups (P, 14); inf where there is none."""
    beyond = np.flatnonzero(trace(watch.ratios, apart).statistic > watch.level)
    return (int(beyond[0]) + 1) * tracks_a_group if beyond.size else math.inf
