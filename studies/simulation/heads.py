"""Heads of simulated people: as a detector of key points sees them, or as it makes them up."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.geometry.ground import ground_from_pixel
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array, aside_of, norm
from models.geometry.upright import heads_seen, statures
from models.tracks.trajectory import Trajectory

_USUAL_M = 1.7  # of people whose top is not in view: their head is not either


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadConfig:
    """Positions of heads over feet; angles in radians, `jitter` a share of the stature.

    `person_sd_rad` is how people differ in their lean to either side, `forward_rad` how far they
    lean the way they walk, `bias_rad` how far a detector puts every head to the right in the
    picture. The jitter of a point correlates by `correlation` with that of the point before.
    """

    jitter: float = 0.03
    correlation: float = 0.5
    person_sd_rad: float = math.radians(1.0)
    forward_rad: float = 0.0
    bias_rad: float = 0.0


def with_heads(
    tracks: Sequence[Trajectory],
    intrinsics: Intrinsics,
    pose: CameraPose,
    config: HeadConfig,
    rng: np.random.Generator,
) -> list[Trajectory]:
    """Tracks of people with boxes, with heads as a camera at a pose sees them."""
    return [_with_heads(track, intrinsics, pose, config, rng) for track in tracks]


def with_box_heads(tracks: Sequence[Trajectory]) -> list[Trajectory]:
    """Tracks with boxes whose heads are the middles of the upper edges: no lean was measured."""
    return [
        track
        if track.top_v is None
        else replace(
            track,
            head_uv=np.where(
                np.isfinite(track.top_v)[:, None],
                np.stack([track.uv[:, 0], track.top_v], axis=1),
                np.nan,
            ),
        )
        for track in tracks
    ]


def _with_heads(
    track: Trajectory,
    intrinsics: Intrinsics,
    pose: CameraPose,
    config: HeadConfig,
    rng: np.random.Generator,
) -> Trajectory:
    ground, _ = ground_from_pixel(intrinsics, pose.rotation, pose.centre_m, track.uv)
    count = len(ground)
    tall = np.full(count, _USUAL_M)
    if track.top_v is not None:
        seen, _ = statures(intrinsics, pose.rotation, pose.height_m, track.uv, track.top_v)
        if np.isfinite(seen).any():
            tall = np.full(count, float(np.nanmedian(seen)))
    way = np.gradient(ground, axis=0) if count > 1 else np.zeros((count, 2))
    way = way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
    away = ground - pose.centre_m[:2]
    right = -aside_of(away) / norm(away)[:, None]
    own = rng.normal(0, config.person_sd_rad, 2)
    lean = own + config.forward_rad * way + config.bias_rad * right
    aside = np.tan(lean) + _jitter(count, config, rng)
    heads = np.concatenate([ground + tall[:, None] * aside, tall[:, None]], axis=1)
    return replace(track, head_uv=heads_seen(intrinsics, pose, heads))


def _jitter(count: int, config: HeadConfig, rng: np.random.Generator) -> Array:
    """Correlated shares of the stature (count, 2) by which heads are beside their place."""
    noise = rng.normal(0, config.jitter, (count, 2))
    keep = config.correlation
    for place in range(1, count):
        noise[place] = keep * noise[place - 1] + math.sqrt(1 - keep**2) * noise[place]
    return noise
