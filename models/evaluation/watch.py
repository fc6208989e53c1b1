"""A drift chart that watches a camera, as the service learns and asks it."""

import math
from dataclasses import dataclass

import numpy as np

from models.drift.chart import RUN, DriftChart, Ratios, ratios_of, trace
from models.drift.chart_learning import learn_chart
from models.drift.party_scores import PartyScores, Usual
from models.estimation.joint.observations import Observations
from models.estimation.joint.site import SiteReference
from models.evaluation.alarms import DAYS
from models.flow.folds import fold_maps
from models.flow.reference import candidate_of, learn_flow
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array

_MOST_ALARMS = 50
_SEED = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Watch:
    """A chart that watches a camera, at the level of a rate of false alarms."""

    chart: DriftChart
    usual: Usual
    ratios: Ratios
    level: float

    def apart(self, scores: PartyScores) -> Array:
        """How far parties (P, 14) are from what is usual."""
        return self.chart.bounded(scores.values) - self.chart.mean

    def alarms(self, apart: Array) -> list[int]:
        """After which of parties (P, 14) there was an alarm; the chart begins anew after each."""
        found: list[int] = []
        while len(found) < _MOST_ALARMS:
            first = found[-1] if found else 0
            beyond = np.flatnonzero(trace(self.ratios, apart[first:]).statistic > self.level)
            if not beyond.size:
                break
            found.append(first + int(beyond[0]) + 1)
        return found


def watch_over(
    reference: Observations,
    intrinsics: Intrinsics,
    prior: CameraPose,
    site: SiteReference,
    *,
    alarms_a_year: float,
    parties_a_day: float,
) -> Watch | None:
    """A chart of reference tracks, as the service learns it; None where too few people walk."""
    folds = fold_maps(reference, intrinsics, candidate_of(prior), _SEED)
    if folds is None:
        return None
    flow = learn_flow(reference, intrinsics, prior, _SEED, folds=folds)
    chart = learn_chart(reference, prior, site, folds, _SEED)
    if flow is None or chart is None:
        return None
    return Watch(
        chart=chart,
        usual=Usual(prior=prior, paces=chart.paces, paths=flow.site(intrinsics)),
        ratios=ratios_of(chart),
        level=chart.level(RUN * alarms_a_year / (parties_a_day * DAYS)),
    )


def first_alarm(watch: Watch, apart: Array, tracks_a_party: float) -> float:
    """Tracks until the first alarm among parties (P, 14); inf where there is none."""
    beyond = np.flatnonzero(trace(watch.ratios, apart).statistic > watch.level)
    return (int(beyond[0]) + 1) * tracks_a_party if beyond.size else math.inf
