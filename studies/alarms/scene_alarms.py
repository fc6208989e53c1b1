"""False alarms and delays on recorded scenes, by the protocol's halves.

One half is the reference, and the people of the other are drawn some walking groups after one
another (a block bootstrap) for as long as is asked. An alarm is the chart's or the pose's,
whichever comes first, as in the service.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from models.assessment import judge
from models.geometry.pose import CameraPose, array_of
from models.monitoring.chart import trace
from models.monitoring.chart_learning import drawn_blocks
from models.monitoring.drift import DriftLimits
from models.monitoring.group_scores import score_groups
from models.paths.likelihood import walkers_of
from models.pose import Observations, observe
from models.simulation.poses import offset_trajectory
from models.tracks.observations import of_tracks
from models.tracks.scenes import Scene
from models.tracks.trajectory import Trajectory, by_end
from models.walking.config import FEWEST_WALKERS
from studies.alarms.results import DAYS, AlarmResults, offsets_of
from studies.alarms.watch import first_alarm, watch_over
from studies.protocol.cases import STILL, draw_case
from studies.protocol.learned import Learned, learn_case
from studies.protocol.served import served_pose

_LONGEST = 1200  # walking groups that a knock is waited for
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
    reference = observe(case.reference, case.intrinsics, case.prior_pose)
    rng = np.random.default_rng([seed, 5])
    groups_a_track = _groups_a_track(reference, case.prior_pose)
    watch = watch_over(
        learned.site,
        alarms_a_year=alarms_a_year,
        groups_a_day=tracks_a_day * groups_a_track,
    )
    if watch is None:
        return None
    still = watch.apart(score_groups(learned.seen, watch.usual))
    wanted = round(years * DAYS * tracks_a_day * groups_a_track)
    walked = still[drawn_blocks(rng, len(still), wanted)]
    delays = []
    for delay, offset in offsets_of(angles_deg, rng):
        moved = offset.apply(scene.true_pose)
        seen = _seen(scene, case.seen, moved)
        apart = watch.apart(score_groups(seen, watch.usual))
        if len(apart):
            by_pose = _tracks_until_drifting(learned, seen, limits)
            drawn = (apart[drawn_blocks(rng, len(apart), _LONGEST)] for _ in range(_DRAWS))
            tracks = seen.tracks / len(apart)
            delays += [
                replace(delay, tracks=min(by_pose, first_alarm(watch, one, tracks)))
                for one in drawn
            ]
    return AlarmResults(
        name=scene.scene_id,
        seed=seed,
        walking_groups=int(watch.chart.walking_groups),
        years=years,
        false_alarms=len(watch.alarms(walked)),
        highest=float(trace(watch.ratios, still).statistic.max()) / watch.level,
        pose_excess=_pose_excess(learned, learned.seen, limits),
        delays=tuple(delays),
    )


def _tracks_until_drifting(learned: Learned, seen: Observations, limits: DriftLimits) -> float:
    """Tracks after which the pose by all until then has drifted beyond its limit; inf: never.

    And had so without the newest people, too. Looked at after some numbers of tracks only: a pose
    takes half a second.
    """
    for number in _LOOKS:
        held = number + limits.people
        if held > seen.tracks:
            break
        if all(
            _pose_excess(learned, of_tracks(seen, np.arange(count)), limits) >= 1
            for count in (number, held)
        ):
            return float(held)
    return math.inf


def _pose_excess(learned: Learned, seen: Observations, limits: DriftLimits) -> float:
    """The largest identifiable drift of the pose by what is seen, in units of its limit."""
    if learned.site.paths is None or seen.walkers < FEWEST_WALKERS:
        return 0.0
    return judge(served_pose(seen, learned.site).drift, limits, ()).excess


def _seen(scene: Scene, tracks: Sequence[Trajectory], moved: CameraPose) -> Observations:
    knocked = (
        offset_trajectory(track, scene.intrinsics, scene.true_pose, moved) for track in tracks
    )
    kept = [track for track in knocked if track is not None and track.long_enough]
    return observe(by_end(kept), scene.intrinsics, scene.true_pose)


def _groups_a_track(observations: Observations, prior: CameraPose) -> float:
    walkers = walkers_of(observations, array_of(prior))
    return max(walkers.walking_groups, 1) / observations.tracks
