"""Simulated sites before many cameras, each seen twice: what the base model is trained on."""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from models.errors import DegenerateGeometryError
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array, Mask
from models.simulation.poses import PoseSet
from models.simulation.walkers import WalkConfig
from studies.base_model.features import FEATURES, segment_features, walking
from studies.base_model.offsets import moved_by, offset_between
from studies.base_model.segments import Segments, segments_of_walks
from studies.simulation.cameras import CameraRange, draw_camera
from studies.simulation.crowds import FlowConfig
from studies.simulation.faults import FaultRange, draw_faults, with_faults
from studies.simulation.flows import simulate_sites

FEWEST_SEGMENTS = 3  # of a look
_POINTS = 11  # of a segment


@dataclass(frozen=True, slots=True, kw_only=True)
class SiteRange:
    """Ranges that sites before a camera, and moves of it, are drawn from.

    A camera moves by up to `angle_rad` in tilt and roll and `log_height`, half of the time by
    `near_share` of it, on `panned_share` of the cameras in heading by N(0, `pan_sd_rad`), too. The
    prior pose and the focal length are wrong by `prior_sd` and `log_focal_sd`, people's pace at a
    later hour by `habit_log_sd`. One look is from the prior pose, a second one from
    `ended_sd` (of tilt, roll, log height) off the truth, where a first answer might have ended.
    """

    flow: FlowConfig = field(
        default_factory=lambda: FlowConfig(
            lanes=(1, 5),
            site_speed_log_sd=0.18,
            speed_slope_log_sd_per_m=0.006,
            slow_share=(0.0, 0.3),
        )
    )
    faults: FaultRange = field(default_factory=FaultRange)
    step_s: tuple[float, float] = (0.27, 0.6)
    angle_rad: float = math.radians(18)
    log_height: float = 0.45
    near_share: float = 0.3
    panned_share: float = 0.4
    pan_sd_rad: float = math.radians(6)
    prior_sd: tuple[float, float, float] = (math.radians(3.0), math.radians(3.5), 0.12)
    log_focal_sd: float = 0.02
    habit_log_sd: float = 0.05
    ended_sd: tuple[float, float, float] = (math.radians(2.0), math.radians(2.0), 0.05)
    no_reference_share: float = 0.15
    fewest_known: int = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedSets:
    """Sites seen twice: features (S, W, F), masks of the windows (S, W), true offsets (S, 3).

    `offsets` are `offset_between` the pose that `seen` was looked at from and where the camera was;
    `reference` is looked at from the prior pose, where it is taken to have been.
    """

    seen: Array
    seen_mask: Mask
    reference: Array
    reference_mask: Mask
    offsets: Array


def simulated_sets(
    cameras: CameraRange,
    sites: SiteRange,
    *,
    count: int,
    sites_each: int,
    people: int,
    rng: np.random.Generator,
) -> SimulatedSets:
    """Sites before so many drawn cameras, two looks each, in no order.

    Sites that show hardly anybody are left out, and cameras before which nobody can walk.
    """
    found: list[SimulatedSets] = []
    for _ in range(count):
        lens, prior = draw_camera(cameras, rng)
        try:
            found += sets_before(lens, prior, sites, sites_each, people, rng)
        except DegenerateGeometryError:
            continue
    return SimulatedSets(
        seen=np.concatenate([each.seen for each in found]),
        seen_mask=np.concatenate([each.seen_mask for each in found]),
        reference=np.concatenate([each.reference for each in found]),
        reference_mask=np.concatenate([each.reference_mask for each in found]),
        offsets=np.concatenate([each.offsets for each in found]),
    )


def sets_before(
    lens: Intrinsics,
    prior: CameraPose,
    ranges: SiteRange,
    sites: int,
    people: int,
    rng: np.random.Generator,
) -> list[SimulatedSets]:
    """Both looks at so many sites before one camera.

    Raises:
        DegenerateGeometryError: no site is seen.
    """
    walk = WalkConfig(step_s=rng.uniform(*ranges.step_s), min_points=_POINTS, max_points=_POINTS)
    moves = rng.uniform(-1, 1, (sites, 3)) * (
        ranges.angle_rad, ranges.angle_rad, ranges.log_height
    )  # fmt: skip
    moves[::2] *= ranges.near_share  # where an answer ends, the next has to be sharp
    # The prior pose is what the site says it is: both visits share how far it is off.
    wrong = rng.normal(0, 1, (sites, 3)) * ranges.prior_sd
    pan = rng.normal(0, ranges.pan_sd_rad) * (rng.random() < ranges.panned_share)
    views = [_around(prior, wrong, 0.0), _around(prior, wrong + moves, pan)]
    visits = simulate_sites(lens, views, people, ranges.flow, walk, rng)
    faults = draw_faults(ranges.faults, sites, rng)
    first, second = (
        segments_of_walks(with_faults(visit, faults, ranges.faults, lens.width, rng), walk.step_s)
        for visit in visits
    )
    focal = math.exp(rng.normal(0, ranges.log_focal_sd))
    believed = replace(lens, fx=lens.fx * focal, fy=lens.fy * focal)
    speeds = walk.speed_mean_mps * np.exp(rng.normal(0, ranges.habit_log_sd, sites))
    assumed = np.full(sites, walk.speed_mean_mps)
    still = [prior] * sites
    reference, known = _looked(believed, first, still, prior, assumed, people)
    # As many as the site gave while its pose was known; some sites gave none.
    upto = np.exp(rng.uniform(math.log(ranges.fewest_known), math.log(people), (sites, 1)))
    upto[rng.random(sites) < ranges.no_reference_share] = 0
    known &= np.arange(people) < upto
    true = [_moved(prior, move) for move in moves]
    ended = [
        moved_by(pose, off)
        for pose, off in zip(true, rng.normal(0, 1, (sites, 3)) * ranges.ended_sd, strict=True)
    ]
    found = []
    for looked_from in (still, ended):
        seen, there = _looked(believed, second, looked_from, prior, speeds, people)
        enough = there.sum(1) >= FEWEST_SEGMENTS
        pairs = zip(looked_from, true, strict=True)
        offsets = np.array([offset_between(one, other) for one, other in pairs])
        found.append(
            SimulatedSets(
                seen=seen[enough],
                seen_mask=there[enough],
                reference=reference[enough],
                reference_mask=known[enough],
                offsets=offsets[enough],
            )
        )
    return found


def _moved(prior: CameraPose, move: Array) -> CameraPose:
    return replace(
        prior,
        height_m=prior.height_m * math.exp(float(move[2])),
        tilt_rad=float(np.clip(prior.tilt_rad + move[0], -math.pi / 2, math.pi / 2)),
        roll_rad=prior.roll_rad + float(move[1]),
    )


def _around(prior: CameraPose, moves: Array, pan: float) -> PoseSet:
    """The poses that are moves (S, 3) of tilt, roll, log height away from the prior pose."""
    poses = [_moved(prior, move) for move in moves]
    return PoseSet(
        height_m=np.array([pose.height_m for pose in poses]),
        tilt_rad=np.array([pose.tilt_rad for pose in poses]),
        roll_rad=np.array([pose.roll_rad for pose in poses]),
        heading_rad=prior.heading_rad + pan,
        x_m=prior.x_m,
        y_m=prior.y_m,
    )


def _looked(
    lens: Intrinsics,
    segments: Segments,
    poses: list[CameraPose],
    prior: CameraPose,
    speeds_mps: Array,
    people: int,
) -> tuple[Array, Mask]:
    """Features (S, W, F) of segments by site, each looked at from its pose, and which are there."""
    features = np.zeros((len(poses), people, FEATURES))
    there = np.zeros((len(poses), people), dtype=np.bool_)
    bounds = np.searchsorted(segments.owner_idx, np.arange(len(poses) + 1))
    for site, pose in enumerate(poses):
        rows = np.arange(bounds[site], bounds[site + 1])
        found = segment_features(segments.take(rows), lens, pose, prior, float(speeds_mps[site]))
        found = found[walking(found)]
        features[site, : len(found)] = found
        there[site, : len(found)] = True
    return features, there
