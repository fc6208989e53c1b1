"""How a drift chart does: false alarms of a camera that stands, tracks until one that was knocked.

For recorded scenes by the protocol's halves: one is the reference, and the people of the other are
drawn some parties after one another (a block bootstrap) for as long as is asked. An alarm is the
chart's or the told pose's, whichever comes first, as in the service.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.drift.chart import RUN, DriftChart, Ratios, ratios_of, trace
from models.drift.chart_learning import learn_chart
from models.drift.party_scores import PartyScores, Usual, score_parties
from models.drift.verdict import DriftLimits, drift_between, judge
from models.estimation.joint.estimate import joint_estimate
from models.estimation.joint.observations import Observations, observe, of_tracks
from models.estimation.joint.site import SiteReference
from models.evaluation.learned import Learned, learn_case
from models.evaluation.protocol import STILL, draw_case
from models.evaluation.scenes import Knock, Scene, knock_trajectory
from models.flow.evidence import walkers_of
from models.flow.folds import fold_maps
from models.flow.fusion import fused_estimate
from models.flow.reference import candidate_of, learn_flow
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array
from models.trajectory import Trajectory

DAYS = 365.25
_BLOCK = 3  # parties after one another that the bootstrap keeps together
_MOST_ALARMS = 50
_LONGEST = 1200  # parties that a knock is waited for
_DRAWS = 10
_REDRAWN = 4000
_NONE_SEEN = 3.689  # of a Poisson variable that was 0, the 97.5 % limit of its mean
_SEED = 0
_LOOKS = (20, 40, 60, 100, 200, 400)  # tracks after which a pose is asked for
_FEWEST_WALKERS = 5  # as the service has it


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
    `told` the largest drift that the pose by that half tells, in units of its limit.
    """

    name: str
    seed: int
    parties: int
    years: float
    false_alarms: int
    highest: float
    told: float
    delays: tuple[Delay, ...]


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


def knocks_of(angles_deg: Sequence[float], rng: np.random.Generator) -> list[tuple[Delay, Knock]]:
    """For each angle a knock in a drawn direction of tilt and roll, and a pan of a drawn sign."""
    found = []
    for angle_deg in angles_deg:
        angle, way = math.radians(angle_deg), rng.uniform(0, 2 * math.pi)
        tilt, roll = angle * math.cos(way), angle * math.sin(way)
        aside = Knock(tilt_rad=tilt, roll_rad=roll, log_height=0.0)
        pan = Knock(
            tilt_rad=0.0, roll_rad=0.0, log_height=0.0, heading_rad=angle * rng.choice([-1.0, 1.0])
        )
        for knock, is_pan in ((aside, False), (pan, True)):
            found.append((Delay(angle_deg=angle_deg, pan=is_pan, tracks=math.inf), knock))
    return found


def judge_scene(
    scene: Scene,
    seed: int,
    *,
    alarms_a_year: float,
    tracks_a_day: float,
    years: float,
    angles_deg: Sequence[float],
    limits: DriftLimits,
) -> AlarmResults | None:
    """False alarms and delays on a recorded scene; None where too few people walk for a chart."""
    case = draw_case(scene, seed, STILL)
    learned = learn_case(case)
    reference = observe(case.reference, case.intrinsics)
    rng = np.random.default_rng([seed, 5])
    parties_a_track = _parties_a_track(reference, case.prior_pose)
    watch = watch_over(
        reference,
        case.intrinsics,
        case.prior_pose,
        learned.site,
        alarms_a_year=alarms_a_year,
        parties_a_day=tracks_a_day * parties_a_track,
    )
    if watch is None:
        return None
    still = watch.apart(score_parties(learned.seen, watch.usual))
    wanted = round(years * DAYS * tracks_a_day * parties_a_track)
    walked = still[_blocks(rng, len(still), wanted)]
    delays = []
    for asked, knock in knocks_of(angles_deg, rng):
        moved = knock.apply(scene.true_pose)
        seen = _seen(scene, case.seen, moved)
        apart = watch.apart(score_parties(seen, watch.usual))
        if len(apart):
            told = _told_after(learned, seen, limits)
            drawn = (apart[_blocks(rng, len(apart), _LONGEST)] for _ in range(_DRAWS))
            tracks = seen.tracks / len(apart)
            delays += [
                replace(asked, tracks=min(told, first_alarm(watch, one, tracks))) for one in drawn
            ]
    return AlarmResults(
        name=scene.scene_id,
        seed=seed,
        parties=int(watch.chart.parties),
        years=years,
        false_alarms=len(watch.alarms(walked)),
        highest=float(trace(watch.ratios, still).statistic.max()) / watch.level,
        told=_told(learned, learned.seen, limits),
        delays=tuple(delays),
    )


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


def first_alarm(watch: Watch, apart: Array, tracks_a_party: float) -> float:
    """Tracks until the first alarm among parties (P, 14); inf where there is none."""
    beyond = np.flatnonzero(trace(watch.ratios, apart).statistic > watch.level)
    return (int(beyond[0]) + 1) * tracks_a_party if beyond.size else math.inf


def _told_after(learned: Learned, seen: Observations, limits: DriftLimits) -> float:
    """Tracks after which the pose by all until then tells a drift beyond its limit; inf: never.

    Looked at after some numbers of tracks only: a pose takes half a second.
    """
    for number in _LOOKS:
        if number > seen.tracks:
            break
        if _told(learned, of_tracks(seen, np.arange(number)), limits) >= 1:
            return float(number)
    return math.inf


def _told(learned: Learned, seen: Observations, limits: DriftLimits) -> float:
    """The largest told drift of the pose by what is seen, in units of its limit."""
    case, flow = learned.case, learned.flow
    if flow is None or seen.walkers < _FEWEST_WALKERS:
        return 0.0
    joint = joint_estimate(seen, case.prior_pose, learned.site)
    fused = fused_estimate(seen, case.intrinsics, case.prior_pose, joint, flow)
    drift = drift_between(fused.values, fused.covariance, fused.told, case.prior_pose)
    return judge(drift, limits, 0, ()).excess


def _seen(scene: Scene, tracks: Sequence[Trajectory], moved: CameraPose) -> Observations:
    knocked = (
        knock_trajectory(track, scene.intrinsics, scene.true_pose, moved) for track in tracks
    )
    kept = [track for track in knocked if track is not None and track.long_enough]
    return observe(kept, scene.intrinsics)


def _parties_a_track(observations: Observations, prior: CameraPose) -> float:
    walkers = walkers_of(observations, candidate_of(prior))
    return max(walkers.parties, 1) / observations.tracks


def _blocks(rng: np.random.Generator, count: int, wanted: int) -> Array:
    starts = rng.integers(0, count, -(-wanted // _BLOCK))
    return np.asarray(((starts[:, None] + np.arange(_BLOCK)).ravel() % count)[:wanted])
