"""Simulated sites with a long reference: how well registration does there, and what misleads it.

A knock is estimated from 25, 100 and 400 tracks. And with the camera still, half of the people take
a new path: that must not look like a move of the camera.
"""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest

import numpy as np

from models.errors import DegenerateGeometryError
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose, array_of
from models.geometry.rotation import Array
from models.quantiles import Z90
from models.reasons import Reason
from models.simulation.poses import PoseOffset
from models.tracks.observations import Observations, of_tracks
from models.tracks.trajectory import Trajectory
from studies.protocol.cases import angle_deg, pose_of_plane_parameters
from studies.simulation.lanes import BETWEEN_S, Lane, SiteConfig, draw_lanes, walk_site
from studies.simulation.simulated_site import (
    LearnedSite,
    SimulatedSite,
    draw_simulated_site,
    learn_simulated_site,
    observe_feet,
    seen_from,
)

REFERENCE_TRACKS = 2000
KNOCKED_TRACKS = (25, 100, 400)
CHANGED_TRACKS = (200, 400)
_KNOCK_RAD = math.radians(8)
_KNOCK_LOG_HEIGHT = 0.15
_MOST_DRAWS = 20
_PLACES_DRAWN = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class OffsetResult:
    """The fused pose after a knock, from so many tracks.

    `errors` are of tilt, roll, heading in degrees and, last, of the log height; `covered` says
    whether the 90 % interval of each holds the truth.
    """

    tracks: int
    errors: tuple[float, ...]
    covered: tuple[bool, ...]
    angle_error_deg: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ChangedResult:
    """The pose of a still camera, when half of so many tracks walk a new path.

    Angles to the truth and to the pose by as many tracks on the old paths, how far these were
    from the truth, and the log of the height against the truth's. `reason` is what the estimate
    says, `registered` whether the map had a part in it, `covered` is as in `OffsetResult`.
    """

    tracks: int
    off_truth_deg: float
    off_unchanged_deg: float
    unchanged_off_truth_deg: float
    off_truth_log_height: float
    covered: tuple[bool, ...]
    reason: Reason | None
    registered: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class SiteResults:
    """All of one site, and the seconds that each part took."""

    site: int
    knock: PoseOffset
    knocked: tuple[OffsetResult, ...]
    changed: tuple[ChangedResult, ...]
    simulated_s: float
    learned_s: float
    estimated_s: float


def study_site(
    site: int,
    seed: int,
    *,
    reference_tracks: int = REFERENCE_TRACKS,
    knocked_tracks: Sequence[int] = KNOCKED_TRACKS,
    changed_tracks: Sequence[int] = CHANGED_TRACKS,
) -> SiteResults:
    """Draw a site, learn it, knock its camera, and then, unknocked, change its people's paths.

    The same site and seed give the same results but for the seconds.

    Raises:
        DegenerateGeometryError: no site could be drawn whose people are seen.
    """
    rng = np.random.default_rng([seed, site])
    started = time.perf_counter()
    simulated = draw_simulated_site(rng)
    known = seen_from(simulated, simulated.prior, reference_tracks, rng)
    knock, after = _knocked(simulated, max(knocked_tracks), rng)
    still = seen_from(simulated, simulated.prior, max(changed_tracks), rng)
    changed = _changed(simulated, max(changed_tracks), rng)
    was_simulated = time.perf_counter()
    learned = learn_simulated_site(simulated, known)
    was_learned = time.perf_counter()
    moved = knock.apply(simulated.prior)
    return SiteResults(
        site=site,
        knock=knock,
        knocked=tuple(_judge_knock(learned, moved, _first(after, n)) for n in knocked_tracks),
        changed=tuple(
            _judge_change(learned, _first(changed, n), _first(still, n)) for n in changed_tracks
        ),
        simulated_s=was_simulated - started,
        learned_s=was_learned - was_simulated,
        estimated_s=time.perf_counter() - was_learned,
    )


def _knocked(
    simulated: SimulatedSite, count: int, rng: np.random.Generator
) -> tuple[PoseOffset, Observations]:
    """A knock after which the people are still seen, and what is seen of them."""
    for _ in range(_MOST_DRAWS):
        tilt, roll, pan = rng.uniform(-_KNOCK_RAD, _KNOCK_RAD, 3)
        log_height = rng.uniform(-_KNOCK_LOG_HEIGHT, _KNOCK_LOG_HEIGHT)
        knock = PoseOffset(
            tilt_rad=float(tilt),
            roll_rad=float(roll),
            log_height=float(log_height),
            heading_rad=float(pan),
        )
        try:
            return knock, seen_from(simulated, knock.apply(simulated.prior), count, rng)
        except DegenerateGeometryError:
            continue
    raise DegenerateGeometryError(f"knock: nobody is seen after any of {_MOST_DRAWS}")


def _changed(simulated: SimulatedSite, count: int, rng: np.random.Generator) -> Observations:
    """Tracks of a still camera: one lane is closed, every other of the people takes a new one."""
    lens, prior, config = simulated.intrinsics, simulated.prior, simulated.config
    for _ in range(_MOST_DRAWS):
        new_lane = draw_new_lane(lens, prior, simulated.lanes, config, rng)
        try:
            tracks = walk_changed(lens, prior, simulated.lanes[1:], new_lane, config, count, rng)
        except DegenerateGeometryError:
            continue
        return observe_feet(tracks, lens, prior)
    raise DegenerateGeometryError(f"new lane: none of {_MOST_DRAWS} is seen")


def draw_new_lane(
    intrinsics: Intrinsics,
    pose: CameraPose,
    lanes: Sequence[Lane],
    config: SiteConfig,
    rng: np.random.Generator,
) -> Lane:
    """A lane that people of a site take when their own is closed, off the lanes there are.

    It passes the visible place that is farthest from all lanes, of a few that are drawn, and its
    direction is midway between two of theirs.

    Raises:
        DegenerateGeometryError: the pose sees no ground within reach.
    """
    places = np.array(
        [
            lane.point
            for _ in range(_PLACES_DRAWN)
            for lane in draw_lanes(intrinsics, pose, config, rng)
        ]
    )
    apart = np.min([_aside_m(lane, places) for lane in lanes], axis=0)
    angles = np.sort([math.atan2(lane.direction[1], lane.direction[0]) % math.pi for lane in lanes])
    gaps = np.diff(np.append(angles, angles[0] + math.pi))
    angle = angles[gaps.argmax()] + gaps.max() / 2
    return Lane(
        point=places[apart.argmax()], direction=np.array([math.cos(angle), math.sin(angle)])
    )


def walk_changed(
    intrinsics: Intrinsics,
    pose: CameraPose,
    lanes: Sequence[Lane],
    new_lane: Lane,
    config: SiteConfig,
    count: int,
    rng: np.random.Generator,
) -> list[Trajectory]:
    """Tracks as of `walk_site`, in time order, of which every other walks a new lane.

    Raises:
        DegenerateGeometryError: hardly any walk is seen from the pose.
    """
    kept = walk_site(intrinsics, pose, lanes, config, count - count // 2, rng)
    new = walk_site(intrinsics, pose, [new_lane], config, count // 2, rng)
    return [
        replace(track, time_s=track.time_s - track.time_s[0] + BETWEEN_S * number)
        for number, track in enumerate(
            track for pair in zip_longest(kept, new) for track in pair if track is not None
        )
    ]


def _aside_m(lane: Lane, places: Array) -> Array:
    """Distances of places (N, 2) from a lane's middle, in metres."""
    normal = np.array([-lane.direction[1], lane.direction[0]])
    return np.asarray(np.abs((places - lane.point) @ normal))


def _first(observations: Observations, count: int) -> Observations:
    return of_tracks(observations, np.arange(min(count, observations.tracks)))


def _judge_knock(learned: LearnedSite, truth: CameraPose, tracks: Observations) -> OffsetResult:
    found = learned.fused(tracks)
    errors = _errors(found.values, truth)
    return OffsetResult(
        tracks=tracks.tracks,
        errors=_printed(errors),
        covered=_covered(errors, found.covariance),
        angle_error_deg=angle_deg(_pose(found.values, truth), truth),
    )


def _judge_change(
    learned: LearnedSite, changed: Observations, still: Observations
) -> ChangedResult:
    truth = learned.simulated.prior
    found, unchanged = learned.fused(changed), learned.fused(still)
    pose, old = (_pose(estimate.values, truth) for estimate in (found, unchanged))
    errors = _errors(found.values, truth)
    return ChangedResult(
        tracks=changed.tracks,
        off_truth_deg=angle_deg(pose, truth),
        off_unchanged_deg=angle_deg(pose, old),
        unchanged_off_truth_deg=angle_deg(old, truth),
        off_truth_log_height=float(errors[2]),
        covered=_covered(errors, found.covariance),
        reason=found.reason,
        registered=found.registered,
    )


def _errors(values: Array, truth: CameraPose) -> Array:
    """Tilt, roll, log height, heading (4,) less the truth's; angles within half a turn."""
    errors = values - array_of(truth)
    for number in (1, 3):
        errors[number] = math.remainder(errors[number], 2 * math.pi)
    return errors


def _covered(errors: Array, covariance: Array) -> tuple[bool, ...]:
    inside = np.abs(errors) <= Z90 * np.sqrt(np.diag(covariance))
    return tuple(bool(inside[number]) for number in (0, 1, 3, 2))


def _printed(errors: Array) -> tuple[float, ...]:
    return (*(math.degrees(errors[number]) for number in (0, 1, 3)), float(errors[2]))


def _pose(values: Array, like: CameraPose) -> CameraPose:
    return replace(pose_of_plane_parameters(values[:3], like), heading_rad=float(values[3]))
