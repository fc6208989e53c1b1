"""A simulated site: lanes, people of different pace and height, pauses, and a tracker's noise."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.errors import DegenerateGeometryError
from models.geometry.ground import ground_from_pixel, pixel_from_ground
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array
from models.geometry.upright import tops_seen
from models.tracks.trajectory import Trajectory

_STEP_S = 0.4
_REACH_M = 40.0  # half the length of a walk
_MOST_DRAWS = 60
BETWEEN_S = 20.0  # one sets out after another


@dataclass(frozen=True, slots=True, kw_only=True)
class SiteConfig:
    """Walks of people at a site, and the noise of what is seen of them.

    Speeds are log-normal: `between_sd` of the log between people, `within_sd` within one, with
    `correlation` between moments 1.5 s apart. `standing_share` of people stand; `aside_m` is how
    far from a lane's middle they walk. Foot points have `noise_px`, as box tops have.
    """

    lanes: int = 3
    speed_mean_mps: float = 1.3
    between_sd: float = 0.18
    within_sd: float = 0.08
    correlation: float = 0.4
    standing_share: float = 0.1
    aside_m: float = 1.5
    stature_mean_m: float = 1.72
    stature_sd: float = 0.04
    noise_px: float = 1.0
    farthest_m: float = 45.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Lane:
    """A straight, endless way on the ground: a point (2,) on it, and its direction (2,)."""

    point: Array
    direction: Array


def draw_lanes(
    intrinsics: Intrinsics, pose: CameraPose, config: SiteConfig, rng: np.random.Generator
) -> list[Lane]:
    """Lanes that pass the visible ground, each in a direction of its own.

    Raises:
        DegenerateGeometryError: the pose sees no ground within reach.
    """
    uv = rng.uniform((0, 0), (intrinsics.width, intrinsics.height), (400, 2))
    ground, valid = ground_from_pixel(intrinsics, pose.rotation, pose.centre_m, uv)
    near = np.linalg.norm(ground - pose.centre_m[:2], axis=1) < config.farthest_m
    ground = ground[valid & near]
    if len(ground) < config.lanes:
        raise DegenerateGeometryError(
            f"pose: no ground within {config.farthest_m:g} m is in the picture"
        )
    angles = rng.uniform(0, math.pi) + np.arange(config.lanes) * math.pi / config.lanes
    return [
        Lane(point=point, direction=np.array([math.cos(angle), math.sin(angle)]))
        for point, angle in zip(rng.permutation(ground)[: config.lanes], angles, strict=True)
    ]


def walk_site(
    intrinsics: Intrinsics,
    pose: CameraPose,
    lanes: Sequence[Lane],
    config: SiteConfig,
    count: int,
    rng: np.random.Generator,
) -> list[Trajectory]:
    """Tracks of `count` people who walk a site's lanes both ways, as a camera at a pose sees them.

    A walk that stays in the picture for less than 5 points over 2 s is drawn again.

    Raises:
        DegenerateGeometryError: hardly any walk is seen from the pose.
    """
    tracks: list[Trajectory] = []
    for number in range(count * _MOST_DRAWS):
        if len(tracks) == count:
            return tracks
        track = _walk(intrinsics, pose, lanes[number % len(lanes)], config, BETWEEN_S * number, rng)
        if track is not None:
            tracks.append(track)
    raise DegenerateGeometryError(
        f"pose: {len(tracks)} of {count} walks are seen in {count * _MOST_DRAWS} draws"
    )


def _walk(
    intrinsics: Intrinsics,
    pose: CameraPose,
    lane: Lane,
    config: SiteConfig,
    start_s: float,
    rng: np.random.Generator,
) -> Trajectory | None:
    speed = config.speed_mean_mps * math.exp(rng.normal(0, config.between_sd))
    speeds = speed * np.exp(_deviations(int(2 * _REACH_M / speed / _STEP_S), config, rng))
    along = (np.cumsum(speeds) - speeds.sum() / 2) * _STEP_S * rng.choice([-1.0, 1.0])
    if rng.uniform() < config.standing_share:
        along = rng.uniform(-_REACH_M, _REACH_M) + rng.normal(0, 0.05, 40)
    aside = rng.normal(0, config.aside_m) * np.array([-lane.direction[1], lane.direction[0]])
    ground = lane.point + aside + along[:, None] * lane.direction
    uv, valid = pixel_from_ground(intrinsics, pose.rotation, pose.centre_m, ground)
    tall = np.full(len(ground), config.stature_mean_m * math.exp(rng.normal(0, config.stature_sd)))
    tops = tops_seen(intrinsics, pose.rotation, pose.centre_m, ground, tall)
    uv = uv + rng.normal(0, config.noise_px, uv.shape)
    tops = tops + rng.normal(0, config.noise_px, tops.shape)
    near = np.linalg.norm(ground - pose.centre_m[:2], axis=1) < config.farthest_m
    seen = valid & near & intrinsics.contains(uv)
    runs = np.split(np.arange(seen.size), np.flatnonzero(np.diff(seen)) + 1)
    longest = max((run for run in runs if seen[run[0]]), key=len, default=np.arange(0))
    if longest.size < 2:
        return None
    time_s = start_s + _STEP_S * longest.astype(np.float64)
    track = Trajectory(time_s=time_s, uv=uv[longest], top_v=tops[longest])
    return track if track.long_enough else None


def _deviations(count: int, config: SiteConfig, rng: np.random.Generator) -> Array:
    """Correlated deviations (count,) of the log speed."""
    keep = config.correlation ** (_STEP_S / 1.5)
    fresh = rng.normal(0, config.within_sd * math.sqrt(1 - keep**2), count)
    deviations = np.empty(count)
    value = rng.normal(0, config.within_sd)
    for place in range(count):
        value = keep * value + fresh[place]
        deviations[place] = value
    return deviations
