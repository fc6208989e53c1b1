"""Simulated cameras over a year of people's habits: false alarms, and delays after knocks."""

from collections.abc import Iterator, Sequence
from itertools import islice

import numpy as np

from models.errors import DegenerateGeometryError
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array
from models.monitoring.chart import trace
from models.monitoring.group_scores import score_groups
from models.pose import learn_site
from models.tracks.trajectory import Trajectory
from studies.alarms.results import DAYS, AlarmResults, Delay, offsets_of
from studies.alarms.watch import Watch, first_alarm, watch_over
from studies.simulation.habits import HabitConfig, draw_mixes, walk_days
from studies.simulation.simulated_site import (
    SPEED_TRACKS,
    SimulatedSite,
    draw_simulated_site,
    observe_feet,
)

_WEEK = 7
_LONGEST_TRACKS = 900  # that a knock is waited for


def live_year(
    site: int,
    seed: int,
    *,
    alarms_a_year: float,
    tracks_a_day: float,
    reference_tracks: int,
    days: int,
    angles_deg: Sequence[float],
) -> AlarmResults:
    """One simulated camera: its reference, then still days without growth, then its knocks.

    The same site and seed give the same results.

    Raises:
        DegenerateGeometryError: no site could be drawn whose people are seen.
    """
    rng = np.random.default_rng([seed, site, 7])
    simulated = draw_simulated_site(rng)
    habits_seed = int(rng.integers(2**31))
    life = _life(simulated, simulated.prior, tracks_a_day, 0, habits_seed)
    # The first that the life drew: after a knock, too, people take the lanes that they took.
    mixes = draw_mixes(len(simulated.lanes), HabitConfig(), np.random.default_rng(habits_seed))
    first: list[Trajectory] = []
    day = 0
    while len(first) < reference_tracks:
        first += next(life)
        day += 1
    reference = observe_feet(first[:reference_tracks], simulated.intrinsics, simulated.prior)
    learned = learn_site(
        reference, simulated.intrinsics, simulated.prior, speed_tracks=SPEED_TRACKS
    )
    watch = watch_over(learned, alarms_a_year=alarms_a_year, groups_a_day=tracks_a_day)
    assert watch is not None
    apart = []
    for _ in range(0, days, _WEEK):
        week = [track for tracks in islice(life, _WEEK) for track in tracks]
        if week:
            seen = observe_feet(week, simulated.intrinsics, simulated.prior)
            apart.append(watch.apart(score_groups(seen, watch.usual)))
    walked = np.concatenate(apart)
    delays = [
        delay
        for wanted, offset in offsets_of(angles_deg, rng)
        if (
            delay := _knocked(
                simulated, mixes, wanted, offset.apply(simulated.prior), watch, day, rng
            )
        )
    ]
    return AlarmResults(
        name=f"site {site}",
        seed=seed,
        walking_groups=int(watch.chart.walking_groups),
        years=days / DAYS,
        false_alarms=len(watch.alarms(walked)),
        highest=float(trace(watch.ratios, walked).statistic.max()) / watch.level,
        pose_excess=0.0,
        delays=tuple(delays),
    )


def _knocked(
    simulated: SimulatedSite,
    mixes: Array,
    delay: Delay,
    moved: CameraPose,
    watch: Watch,
    day: int,
    rng: np.random.Generator,
) -> Delay | None:
    """Tracks until the alarm; None where nobody is seen from the new pose."""
    seen: list[Trajectory] = []
    try:
        seed = int(rng.integers(2**31))
        for tracks in _life(simulated, moved, _LONGEST_TRACKS / 5, day, seed, mixes):
            seen += tracks
            if len(seen) >= _LONGEST_TRACKS:
                break
    except DegenerateGeometryError:
        return None
    observations = observe_feet(seen[:_LONGEST_TRACKS], simulated.intrinsics, simulated.prior)
    scores = score_groups(observations, watch.usual)
    if not scores.last.size:
        return None
    groups_a_track = observations.tracks / scores.last.size
    return Delay(
        angle_deg=delay.angle_deg,
        pan=delay.pan,
        tracks=first_alarm(watch, watch.apart(scores), groups_a_track),
    )


def _life(
    simulated: SimulatedSite,
    pose: CameraPose,
    tracks_a_day: float,
    day: int,
    seed: int,
    mixes: Array | None = None,
) -> Iterator[list[Trajectory]]:
    return walk_days(
        simulated.intrinsics,
        pose,
        simulated.lanes,
        simulated.config,
        HabitConfig(),
        tracks_a_day=tracks_a_day,
        days=range(day, 10**6),
        rng=np.random.default_rng(seed),
        mixes=mixes,
    )
