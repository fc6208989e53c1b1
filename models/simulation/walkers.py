"""People who walk at a steady speed and turn slowly, seen inside the image."""

import math
from dataclasses import dataclass

import numpy as np

from models.errors import DegenerateGeometryError
from models.geometry.ground import ground_from_pixel, pixel_from_ground
from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array, Index, Mask
from models.simulation.poses import PoseSet
from models.tracks.trajectory import DEFAULT_STEP_S, WINDOW_MAX_POINTS, WINDOW_MIN_POINTS

_ROUNDS = 60
_SHORTER_AFTER = 15  # rounds after which a walk that never fits is asked for with fewer points


@dataclass(frozen=True, slots=True, kw_only=True)
class WalkConfig:
    """Walks of simulated people. The paper's speeds are V ~ N(1.4, 0.1^2) m/s (Carey 2005)."""

    speed_mean_mps: float = 1.4
    speed_sd_mps: float = 0.1
    turn_sd_rad_per_s: float = math.radians(3)
    step_s: float = DEFAULT_STEP_S
    min_points: int = WINDOW_MIN_POINTS
    max_points: int = WINDOW_MAX_POINTS
    farthest_m: float = 60.0  # beyond this no tracker follows feet


@dataclass(frozen=True, slots=True, kw_only=True)
class Walks:
    """B simulated walks, one for each pose that allowed one.

    `uv` is (B, T, 2) in pixels and NaN after the first `lengths` (B,) points; `pose_idx` (B,) are
    places in the pose set that was asked for. Poses that see no ground give no walk.
    """

    uv: Array
    lengths: Index
    pose_idx: Index

    def __len__(self) -> int:
        return int(self.lengths.size)


def simulate_walks(
    intrinsics: Intrinsics, poses: PoseSet, config: WalkConfig, rng: np.random.Generator
) -> Walks:
    """One walk for each pose: constant speed, slowly turning heading, wholly inside the image.

    A walk passes a pixel drawn evenly over the picture's ground, at any of its points, in an even
    direction: so people come as often as they go. One that leaves the image is drawn again; after
    many vain draws, with fewer points.

    Raises:
        DegenerateGeometryError: no pose at all sees enough ground for a walk.

    Source: Xu et al. 2020, section 3.2.
    """
    count = len(poses)
    wanted = rng.integers(config.min_points, config.max_points + 1, count)
    speed = np.maximum(rng.normal(config.speed_mean_mps, config.speed_sd_mps, count), 0.05)
    uv = np.full((count, config.max_points, 2), np.nan)
    lengths = np.zeros(count, dtype=np.int64)
    open_idx = np.arange(count, dtype=np.int64)
    for round_no in range(_ROUNDS):
        if round_no >= _SHORTER_AFTER:
            wanted[open_idx] = rng.integers(config.min_points, wanted[open_idx] + 1)
        drawn, fits = _draw(intrinsics, poses.take(open_idx), speed[open_idx], wanted[open_idx],
                            config, rng)  # fmt: skip
        done = open_idx[fits]
        uv[done], lengths[done] = drawn[fits], wanted[done]
        open_idx = open_idx[~fits]
        if not open_idx.size:
            break
    made = np.flatnonzero(lengths)
    if not made.size:
        raise DegenerateGeometryError(
            f"poses: none of {count} sees ground within {config.farthest_m:g} m for a walk of "
            f"{config.min_points} points"
        )
    return Walks(uv=uv[made], lengths=lengths[made], pose_idx=made)


def _draw(
    intrinsics: Intrinsics,
    poses: PoseSet,
    speed_mps: Array,
    wanted: Index,
    config: WalkConfig,
    rng: np.random.Generator,
) -> tuple[Array, Mask]:
    """Candidate walks (B, T, 2), NaN after the wanted points, and which lie inside the image."""
    count = len(poses)
    rotation, centre = poses.rotation, poses.centre_m
    anchor_uv = rng.uniform((-0.5, -0.5), (intrinsics.width - 0.5, intrinsics.height - 0.5),
                           (count, 1, 2))  # fmt: skip
    anchor, on_ground = ground_from_pixel(intrinsics, rotation, centre, anchor_uv)
    anchor_idx = rng.integers(0, wanted)
    distance = np.linalg.norm(anchor[:, 0] - centre[:, :2], axis=-1)
    direction = rng.uniform(0, 2 * math.pi, count)
    turn = rng.normal(0, config.turn_sd_rad_per_s, count)
    possible = on_ground[:, 0] & (distance < config.farthest_m)

    uv = np.full((count, config.max_points, 2), np.nan)
    fits = np.zeros(count, dtype=np.bool_)
    row = np.flatnonzero(possible)
    steps = np.arange(config.max_points)
    since_anchor = steps[:-1] - anchor_idx[row, None]
    heading = direction[row, None] + turn[row, None] * config.step_s * since_anchor
    stride = (speed_mps[row] * config.step_s)[:, None, None]
    moves = stride * np.stack([np.sin(heading), np.cos(heading)], axis=-1)
    walk = np.pad(np.cumsum(moves, axis=1), ((0, 0), (1, 0), (0, 0)))
    path = anchor[row] + walk - np.take_along_axis(walk, anchor_idx[row, None, None], axis=1)
    walked = steps < wanted[row, None]
    near = (np.linalg.norm(path - centre[row, None, :2], axis=-1) < config.farthest_m) | ~walked
    # The two ends alone rule out most candidates; only the rest are projected whole.
    last = np.take_along_axis(path, wanted[row, None, None] - 1, axis=1)
    ends = np.concatenate([path[:, :1], last], axis=1)
    ends_uv, _ = pixel_from_ground(intrinsics, rotation[row], centre[row], ends)
    keep = near.all(-1) & intrinsics.contains(ends_uv).all(-1)
    row, path, walked = row[keep], path[keep], walked[keep]
    seen, _ = pixel_from_ground(intrinsics, rotation[row], centre[row], path)
    fits[row] = (intrinsics.contains(seen) | ~walked).all(-1)
    uv[row] = np.where(walked[..., None], seen, np.nan)
    return uv, fits
