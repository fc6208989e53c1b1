"""A long recording in its order: a reference, then batch after batch, still or moved on the way.

As the service would see it with a map that never grows: what is served, what alarms, and when.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.assessment import AssessmentLimits
from models.durations import DAY_S
from models.geometry.pose import CameraPose
from models.pose import DriftLimits, Trajectory, learn_site, observe
from models.reasons import TracksCode
from models.simulation.poses import PoseOffset
from models.tracks.scenes import Scene, SceneTrack
from models.tracks.trajectory import by_end
from studies.protocol.partings import first_seen
from studies.served.outcomes import ParameterOutcome, parameters_beside, reason_of
from studies.served.windows import AssessedWindow, Window, assessed_windows

_YEAR_S = 365.25 * DAY_S
_MOVED_BETWEEN = (0.2, 0.8)  # of the tracks after the reference
_MEASURED_AFTER = 250  # tracks


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplayPlan:
    """Plan of a recording's replay: its windows, and what an alarm goes by."""

    window: Window
    limits: DriftLimits
    alarms_a_year: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretch:
    """Summary of a time in which a camera stood where it was.

    `tracks` came, of which after `alarm_after` there was the first alarm; None where there was
    none. Shares are of the `looks`: with the map in use, with paths that are said to have changed.
    `identifiable` and `covered` count looks by tilt, roll, height, heading: where it was, and where
    its interval held the truth of those; `worst_sd` is the largest error of such a parameter in
    standard deviations. `cuts` is how many changes were found.
    """

    tracks: int
    looks: int
    alarm_after: int | None
    mapped: float
    paths_changed: float
    identifiable: tuple[int, ...]
    covered: tuple[int, ...]
    worst_sd: float
    cuts: int


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplayOutcome:
    """A replay: before the move, and after it, with its parameters from 250 tracks on.

    A replay that is still has no `after`. `measured` is None where so many did not come.
    """

    reference_tracks: int
    charted: bool
    before: Stretch
    after: Stretch | None
    measured: tuple[ParameterOutcome, ...] | None
    seconds: float


def replay(
    scene: Scene, knock: PoseOffset | None, seed: int, reference_tracks: int, plan: ReplayPlan
) -> ReplayOutcome:
    """Replay a recording after a reference of so many tracks, moved at a drawn moment by a knock.

    Whoever is in the picture while it moves is lost. Without a knock it stands.

    Raises:
        TooFewTrajectoriesError: the reference tells nothing.
    """
    started = time.monotonic()
    rng = np.random.default_rng(seed)
    prior = scene.true_pose
    known = first_seen(scene, scene.tracks, prior, reference_tracks)
    names = {track.track_id for track in known}
    learned_s = max(float(track.trajectory.time_s[-1]) for track in known)
    rest = [t for t in scene.tracks if t.track_id not in names and _start(t) > learned_s]
    moved, moved_s = prior, np.inf
    if knock is not None and rest:
        moved = knock.apply(prior)
        moved_s = _start(rest[int(rng.uniform(*_MOVED_BETWEEN) * len(rest))])
    before = [t for t in first_seen(scene, rest, prior, None) if t.trajectory.time_s[-1] < moved_s]
    after = first_seen(scene, [t for t in rest if _start(t) >= moved_s], moved, None)
    stills, seen = _in_order(before), _in_order(after)
    reference = observe(_in_order(known), scene.intrinsics, prior)
    site = learn_site(reference, scene.intrinsics, prior)
    span_s = max(_start(rest[-1]) - learned_s, 1.0) if rest else 1.0
    limits = AssessmentLimits(
        drift=plan.limits,
        alarms_a_year=plan.alarms_a_year,
        tracks_a_year=_YEAR_S * max(len(rest), 1) / span_s,
    )
    found = list(assessed_windows((*stills, *seen), site, plan.window, limits))
    one = [each for each in found if each.tracks <= len(stills)]
    other = found[len(one) :]
    measured = next((w for w in other if w.tracks >= len(stills) + _MEASURED_AFTER), None)
    return ReplayOutcome(
        reference_tracks=len(known),
        charted=site.chart is not None,
        before=_stretch(one, 0, len(stills), prior, prior),
        after=_stretch(other, len(stills), len(seen), prior, moved) if knock is not None else None,
        measured=None
        if measured is None
        else parameters_beside(measured.assessment.estimated, prior, moved),
        seconds=time.monotonic() - started,
    )


def _stretch(
    found: Sequence[AssessedWindow], since: int, tracks: int, prior: CameraPose, truth: CameraPose
) -> Stretch:
    estimated = [each.assessment.estimated for each in found]
    parameters = [parameters_beside(each, prior, truth) for each in estimated]
    known = [[n.identifiable for n in each] for each in parameters]
    covered = [[n.identifiable and n.covered for n in each] for each in parameters]
    reasons = [reason_of(each) for each in estimated]
    alarms = (each.tracks - since for each in found if each.assessment.decision.verdict.drifting)
    return Stretch(
        tracks=tracks,
        looks=len(found),
        alarm_after=next(alarms, None),
        mapped=_share([each.fused.registered for each in estimated]),
        paths_changed=_share([reason == TracksCode.PATHS_CHANGED for reason in reasons]),
        identifiable=_counts(known),
        covered=_counts(covered),
        worst_sd=max(
            (n.off_sd for each in parameters for n in each if n.identifiable), default=0.0
        ),
        cuts=sum(each.cut is not None for each in found),
    )


def _counts(rows: Sequence[Sequence[bool]]) -> tuple[int, ...]:
    return tuple(int(column) for column in np.array(rows, dtype=int).reshape(-1, 4).sum(axis=0))


def _share(flags: Sequence[bool]) -> float:
    return float(np.mean(flags)) if flags else 0.0


def _start(track: SceneTrack) -> float:
    return float(track.trajectory.time_s[0])


def _in_order(tracks: Sequence[SceneTrack]) -> list[Trajectory]:
    return by_end(track.trajectory for track in tracks)
