"""False alarms and delays on recorded scenes, by the protocol's halves.

One half is the reference, and the people of the other are drawn some parties after one another (a
block bootstrap) for as long as is asked. An alarm is the chart's or the told pose's, whichever
comes first, as in the service.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from models.drift.chart import trace
from models.drift.chart_learning import drawn_blocks
from models.drift.party_scores import score_parties
from models.drift.verdict import DriftLimits, judge
from models.estimation.joint.observations import of_tracks
from models.estimation.joint.reference import FEWEST_WALKERS
from models.evaluation.alarms.results import DAYS, AlarmResults, knocks_of
from models.evaluation.alarms.watch import first_alarm, watch_over
from models.evaluation.protocol.cases import STILL, draw_case
from models.evaluation.protocol.learned import Learned, learn_case
from models.evaluation.protocol.served import served_pose
from models.evaluation.scenes import Scene
from models.flow.likelihood import walkers_of
from models.flow.reference import candidate_of
from models.geometry.pose import CameraPose
from models.recalibration import Observations, observe
from models.simulation.knocked import knock_trajectory
from models.trajectory import Trajectory

_LONGEST = 1200  # parties that a knock is waited for
_DRAWS = 10
_LOOKS = (20, 40, 60, 100, 200, 400)  # tracks after which a pose is asked for


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
    learned = learn_case(case, chart=True)
    reference = observe(case.reference, case.intrinsics)
    rng = np.random.default_rng([seed, 5])
    parties_a_track = _parties_a_track(reference, case.prior_pose)
    watch = watch_over(
        learned.site,
        alarms_a_year=alarms_a_year,
        parties_a_day=tracks_a_day * parties_a_track,
    )
    if watch is None:
        return None
    still = watch.apart(score_parties(learned.seen, watch.usual))
    wanted = round(years * DAYS * tracks_a_day * parties_a_track)
    walked = still[drawn_blocks(rng, len(still), wanted)]
    delays = []
    for asked, knock in knocks_of(angles_deg, rng):
        moved = knock.apply(scene.true_pose)
        seen = _seen(scene, case.seen, moved)
        apart = watch.apart(score_parties(seen, watch.usual))
        if len(apart):
            told = _told_after(learned, seen, limits)
            drawn = (apart[drawn_blocks(rng, len(apart), _LONGEST)] for _ in range(_DRAWS))
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


def _told_after(learned: Learned, seen: Observations, limits: DriftLimits) -> float:
    """Tracks after which the pose by all until then tells a drift beyond its limit; inf: never.

    And told it without the newest people, too. Looked at after some numbers of tracks only: a pose
    takes half a second.
    """
    for number in _LOOKS:
        held = number + limits.people
        if held > seen.tracks:
            break
        if all(
            _told(learned, of_tracks(seen, np.arange(count)), limits) >= 1
            for count in (number, held)
        ):
            return float(held)
    return math.inf


def _told(learned: Learned, seen: Observations, limits: DriftLimits) -> float:
    """The largest told drift of the pose by what is seen, in units of its limit."""
    if learned.site.flow is None or seen.walkers < FEWEST_WALKERS:
        return 0.0
    return judge(served_pose(seen, learned.site).drift, limits, ()).excess


def _seen(scene: Scene, tracks: Sequence[Trajectory], moved: CameraPose) -> Observations:
    knocked = (
        knock_trajectory(track, scene.intrinsics, scene.true_pose, moved) for track in tracks
    )
    kept = [track for track in knocked if track is not None and track.long_enough]
    return observe(sorted(kept, key=lambda track: float(track.time_s[-1])), scene.intrinsics)


def _parties_a_track(observations: Observations, prior: CameraPose) -> float:
    walkers = walkers_of(observations, candidate_of(prior))
    return max(walkers.parties, 1) / observations.tracks
