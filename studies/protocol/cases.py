"""The virtual offset: real tracks of a still camera, parted, moved and given to an estimator."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import PLANE_PARAMETERS, CameraPose, plane_parameters_of
from models.geometry.rotation import Array, angle_between
from models.quantiles import Z90
from models.simulation.poses import PoseOffset
from models.tracks.scenes import Scene, SceneTrack
from models.tracks.trajectory import Trajectory, by_end
from studies.faults.catalogue import Fault
from studies.faults.view import view_of
from studies.protocol.partings import (
    HALVES_OF_PEOPLE,
    Parting,
    first_seen,
    part_people,
)

_UNKNOWN_SD = (math.radians(10), math.radians(10), 0.3)  # where there are too few tracks


@dataclass(frozen=True, slots=True, kw_only=True)
class OffsetRange:
    """Largest pose offset either way: uniform in angles and in the log of the height."""

    tilt_rad: float = 0.0
    roll_rad: float = 0.0
    log_height: float = 0.0
    heading_rad: float = 0.0


_FAR, _HARD = math.radians(8), math.radians(15)
STILL = OffsetRange()
KNOCKED = OffsetRange(tilt_rad=_FAR, roll_rad=_FAR, log_height=0.15)
HARD = OffsetRange(tilt_rad=_HARD, roll_rad=_HARD, log_height=0.35)
PANNED = replace(KNOCKED, heading_rad=_FAR)
HARD_PANNED = replace(HARD, heading_rad=math.radians(20))
RANGES = {
    "still": STILL,
    "knock": KNOCKED,
    "hard": HARD,
    "pan": PANNED,
    "hard-pan": HARD_PANNED,
    "tilt-alone": OffsetRange(tilt_rad=_FAR),
    "roll-alone": OffsetRange(roll_rad=_FAR),
    "height-alone": OffsetRange(log_height=0.15),
    "pan-alone": OffsetRange(heading_rad=_FAR),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class ProtocolCase:
    """Case as the service would see it: tracks at the prior pose, then tracks after a pose offset.

    `prior_pose` is the scene's true pose; `true_pose` where the camera is after the offset.
    """

    scene_id: str
    seed: int
    intrinsics: Intrinsics
    prior_pose: CameraPose
    true_pose: CameraPose
    reference: tuple[Trajectory, ...]
    seen: tuple[Trajectory, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """Answer of an estimator: tilt, roll and log height (3,), their covariance (3, 3).

    `identifiable` names those of the three that it says the tracks determine. `heading_rad` and its
    standard deviation are what it says of the heading; None is the prior's.
    """

    values: Array
    covariance: Array
    tracks: int
    identifiable: tuple[str, ...] = PLANE_PARAMETERS
    heading_rad: float | None = None
    heading_sd_rad: float | None = None


Estimator = Callable[[ProtocolCase], Answer]


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """One case of one estimator. Triples are tilt and roll in degrees and log height.

    `tracks` were seen after the offset, of which `used` gave the estimator something to go by. The
    angle error is that of the whole rotation, heading included; `tilt_roll_error_deg` is what it
    would be were the heading right. `heading_error_deg` and whether its interval `heading_covered`
    the truth are None for an estimator that says nothing of it. `seconds` are those of the answer,
    less what all estimators of the case share.
    """

    scene_id: str
    estimator: str
    seed: int
    tracks: int
    used: int
    true_drift: tuple[float, float, float]
    drift: tuple[float, float, float]
    sd: tuple[float, float, float]
    angle_error_deg: float
    tilt_roll_error_deg: float
    true_heading_drift_deg: float
    height_error: float
    covered: tuple[bool, bool, bool]
    degenerate: bool
    seconds: float
    heading_error_deg: float | None = None
    heading_covered: bool | None = None


def draw_case(
    scene: Scene,
    seed: int,
    offset_range: OffsetRange,
    parting: Parting = HALVES_OF_PEOPLE,
    fault: Fault | None = None,
    heading_rad: float | None = None,
    still_share: float = 0.0,
    offset: PoseOffset | None = None,
) -> ProtocolCase:
    """Part a scene's people in two and offset the camera before the second.

    The protocol of `docs/results/protocol.md`. The same scene and seed give the same parts
    and, up to the range, the same direction of the offset, however they are parted.

    Args:
        scene: whose people.
        seed: of the parts, the offset and the fault.
        offset_range: how far the offset may go.
        parting: who is the reference, and who comes after the offset.
        fault: what is wrong with the tracks, before the offset too unless it sets in later.
        heading_rad: the offset of the heading; else it is drawn, too.
        still_share: the share of those who come after the reference whom the still camera sees;
            who is in the picture while it moves is left out.
        offset: of the pose, in place of one that is drawn.
    """
    rng = np.random.default_rng(seed)
    parts = part_people(scene, parting, rng)
    tilt, roll = rng.uniform(-1, 1, 2) * (offset_range.tilt_rad, offset_range.roll_rad)
    drawn = PoseOffset(
        tilt_rad=tilt,
        roll_rad=roll,
        log_height=rng.uniform(-1, 1) * offset_range.log_height,
        heading_rad=rng.uniform(-1, 1) * offset_range.heading_rad,
    )
    offset = offset or drawn
    if heading_rad is not None:
        offset = replace(offset, heading_rad=heading_rad)
    still, moved = scene.true_pose, offset.apply(scene.true_pose)
    begin = rng.uniform() if parting.seen_tracks is not None else 0.0
    unmoved = still if scene.beyond_picture else None
    reference: Sequence[SceneTrack] = first_seen(
        scene, parts.reference, unmoved, parting.reference_tracks
    )
    later = parts.later
    if parting.seen_tracks is not None:
        later = later[int(begin * max(len(later) - parting.seen_tracks, 0)) :]
    most = len(later) if parting.seen_tracks is None else min(len(later), parting.seen_tracks)
    ends = sorted(float(track.trajectory.time_s[-1]) for track in later[:most])
    moved_s = ends[int(still_share * most) - 1] if still_share * most >= 1 else -math.inf
    before = [track for track in later[:most] if track.trajectory.time_s[-1] <= moved_s]
    after = [track for track in later if track.trajectory.time_s[0] > moved_s]
    seen: Sequence[SceneTrack] = [
        *first_seen(scene, before, unmoved, None),
        *first_seen(scene, after, moved, most - len(before)),
    ]
    if fault is not None:
        if not fault.later:
            reference = fault.inject(reference, view_of(scene), seed)
        seen = fault.inject(seen, view_of(scene, moved), seed)
    return ProtocolCase(
        scene_id=scene.scene_id,
        seed=seed,
        intrinsics=scene.intrinsics,
        prior_pose=still,
        true_pose=moved,
        reference=_taken(reference),
        seen=_taken(seen),
    )


def judge_answer(case: ProtocolCase, estimator: str, answer: Answer, seconds: float) -> Outcome:
    """An estimator's answer beside the truth."""
    true, prior = plane_parameters_of(case.true_pose), plane_parameters_of(case.prior_pose)
    error = answer.values - true
    error[1] = math.remainder(error[1], 2 * math.pi)
    sd = np.sqrt(np.diag(answer.covariance))
    pose = pose_of_plane_parameters(answer.values, case.prior_pose)
    level = pose_of_plane_parameters(answer.values, case.true_pose)
    heading_error = heading_covered = None
    if answer.heading_rad is not None and answer.heading_sd_rad is not None:
        pose = replace(pose, heading_rad=answer.heading_rad)
        off = math.remainder(answer.heading_rad - case.true_pose.heading_rad, 2 * math.pi)
        heading_error = math.degrees(off)
        heading_covered = abs(off) <= Z90 * answer.heading_sd_rad
    covered = np.abs(error) <= Z90 * sd
    return Outcome(
        scene_id=case.scene_id,
        estimator=estimator,
        seed=case.seed,
        tracks=len(case.seen),
        used=answer.tracks,
        true_drift=_printed(true - prior),
        drift=_printed(true + error - prior),
        sd=_printed(sd),
        angle_error_deg=angle_deg(pose, case.true_pose),
        tilt_roll_error_deg=angle_deg(level, case.true_pose),
        true_heading_drift_deg=math.degrees(
            case.true_pose.heading_rad - case.prior_pose.heading_rad
        ),
        height_error=abs(math.expm1(error[2])),
        covered=(bool(covered[0]), bool(covered[1]), bool(covered[2])),
        degenerate=len(answer.identifiable) < len(PLANE_PARAMETERS),
        seconds=seconds,
        heading_error_deg=heading_error,
        heading_covered=heading_covered,
    )


def nothing_identifiable(case: ProtocolCase) -> Answer:
    """The answer to too few tracks: the prior pose, and that nothing is known of it."""
    return Answer(
        values=plane_parameters_of(case.prior_pose),
        covariance=np.diag(np.square(_UNKNOWN_SD)),
        tracks=0,
        identifiable=(),
    )


def pose_of_plane_parameters(numbers: Array, prior: CameraPose) -> CameraPose:
    """The pose of tilt, roll and log height; x, y and heading are the prior pose's."""
    tilt, roll, log_height = (float(number) for number in numbers)
    return CameraPose(
        height_m=math.exp(log_height),
        tilt_rad=float(np.clip(tilt, -math.pi / 2, math.pi / 2)),
        roll_rad=roll,
        heading_rad=prior.heading_rad,
        x_m=prior.x_m,
        y_m=prior.y_m,
    )


def _taken(tracks: Sequence[SceneTrack]) -> tuple[Trajectory, ...]:
    """Trajectories that the service takes, in the order that trackers post: as the tracks end."""
    return tuple(by_end(t.trajectory for t in tracks if t.trajectory.long_enough))


def angle_deg(one: CameraPose, other: CameraPose) -> float:
    """The whole rotation between two poses, in degrees."""
    return math.degrees(float(angle_between(one.quaternion_wxyz, other.quaternion_wxyz)))


def _printed(triple: Array) -> tuple[float, float, float]:
    return (math.degrees(triple[0]), math.degrees(triple[1]), float(triple[2]))
