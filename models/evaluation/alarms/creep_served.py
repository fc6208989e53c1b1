"""What is served of a camera that creeps, by a map that grows as in the service; or as it once did.

As it once did: whatever was known to be still but for the newest 100 tracks, as it was seen. As it
does: only what ended before the window that the map judges, without the turn that is believed.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from models.drift.creep import SHARE, read_creep
from models.evaluation.alarms.creep_years import MONTH_DAYS, CreepPlan, Life, turned
from models.evaluation.studies.simulated_site import observe_feet
from models.recalibration import (
    begin_creep_log,
    estimate_pose,
    learn_site,
    log_creep,
    without_creep,
)
from models.simulation.habits import DAY_S
from models.trajectory import Trajectory

_KEPT_DAYS, _WINDOW_DAYS, _WINDOW_TRACKS = 30, 7, 400
_UNSURE = 100
_HALF_LIFE_S = 30 * DAY_S
_FEWEST_NEW, _NEW_SHARE, _MOST = 50, 0.25, 2000
_FEWEST = 30


@dataclass(frozen=True, slots=True, kw_only=True)
class ServedTurn:
    """A camera that has crept for some `days`, by `true_deg`: what is served of that number.

    `told` says whether the tracks can tell it, `crept` whether the creep has been told by then.
    """

    days: int
    true_deg: float
    served_deg: float
    sd_deg: float
    told: bool
    crept: bool


def serve_creeping(
    site: int, seed: int, number: str, rate_deg: float, plan: CreepPlan, *, every: int, once: bool
) -> list[ServedTurn]:
    """What is served every so many days; `once`: by the growth of before there were anchors.

    Raises:
        DegenerateGeometryError: no site could be drawn whose people are seen.
    """
    life = Life(site, seed, plan)
    lens, prior = life.simulated.intrinsics, life.simulated.prior
    log = begin_creep_log(life.first, life.to_s)
    assert log is not None
    grown, known, grown_to_s = life.first, plan.reference_tracks, life.to_s
    crept, kept = False, list(life.reference)
    served = []
    for days in range(1, plan.days + 1):
        true_deg = rate_deg * days / MONTH_DAYS
        tracks = life.next_day(turned(prior, number, true_deg))
        kept = [t for t in kept + tracks if t.time_s[-1] > (life.day + 1 - _KEPT_DAYS) * DAY_S]
        if tracks:
            log = log_creep(log, observe_feet(tracks, lens), life.first)
        found = read_creep(log, SHARE * plan.alarms_a_year)
        crept = crept or (not once and found is not None and found.moved)
        window = _window(kept, life.to_s)
        if days % every == 0 and len(window) >= _FEWEST:
            judged_by = life.first if crept else grown
            pose = estimate_pose(observe_feet(window, lens), judged_by)
            by, sd = pose.drift.of(number)
            served.append(
                ServedTurn(
                    days=days,
                    true_deg=true_deg,
                    served_deg=math.degrees(by),
                    sd_deg=math.degrees(sd),
                    told=number in pose.drift.identifiable,
                    crept=crept,
                )
            )
        before_s = window[0].time_s[-1] if window and not once else math.inf
        still = [t for t in kept[:-_UNSURE] if t.time_s[-1] < before_s or t.time_s[-1] <= life.to_s]
        new = sum(t.time_s[-1] > grown_to_s for t in still)
        if crept or new < max(_FEWEST_NEW, _NEW_SHARE * known):
            continue
        still = still[-_MOST:]
        known, grown_to_s = len(still), float(still[-1].time_s[-1])
        seen = still if once else [t for t in without_creep(still, lens, prior, log) if t]
        ages_s = grown_to_s - np.sort([t.time_s[-1] for t in seen])
        grown = learn_site(
            observe_feet(seen, lens),
            lens,
            prior,
            speed_reference=life.first.speed_reference,
            weights=0.5 ** (ages_s / _HALF_LIFE_S),
            chart=False,
        )
        grown = replace(grown, chart=life.first.chart)
    return served


def _window(kept: list[Trajectory], to_s: float) -> list[Trajectory]:
    newest_s = kept[-1].time_s[-1] if kept else 0.0
    oldest_s = max(newest_s - _WINDOW_DAYS * DAY_S, to_s)
    return [t for t in kept if t.time_s[-1] > oldest_s][-_WINDOW_TRACKS:]
