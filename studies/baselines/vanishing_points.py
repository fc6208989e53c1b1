"""The camera's orientation from vanishing points of people's heads and feet, the lens known.

A straight line in the world and the camera's centre span a plane; parallel lines' planes all hold
their common direction. Heads over feet are such lines, upwards; so are the lines between two places
of one walker, feet and heads, since nobody grows on the way.

Sources: orthogonal directions of one walker, Huang et al. 2016, to which Xu et al. 2020 compare
(table 3); a vertical and a horizon of many people, Lv, Zhao and Nevatia 2006, section 3.
"""

from collections.abc import Sequence

import numpy as np

from models.errors import TooFewTrajectoriesError
from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array, angles_from_rotation
from models.tracks.trajectory import Trajectory

_LEAST_POINTS = 3
_APART = 0.25  # of a walk's points: places nearer than that hardly tell where it leads
_ROUNDS = 30
_CAUCHY = 2.385  # of a residual's scale: 95 % as efficient as least squares on normal errors
_MAD = 1.4826  # a normal standard deviation, of the median of absolute residuals


def orientation_of_walker(intrinsics: Intrinsics, track: Trajectory) -> Array:
    """The rotation `camera_from_walk` (3, 3) of one walker's three orthogonal directions.

    The walk's frame has the walker's way as its +Y and up as its +Z: its heading is against the
    walker's way, and no two walkers share it.

    Raises:
        TooFewTrajectoriesError: fewer than 3 points with a head, or nobody moved.
    """
    feet, heads = rays_of(intrinsics, track)
    if len(feet) < _LEAST_POINTS:
        raise TooFewTrajectoriesError(
            f"track: {_LEAST_POINTS} points with a head are needed, got {len(feet)}"
        )
    up = _upwards(_held_by(_planes(feet, heads)), feet, heads)
    walk = np.cross(_held_by(feet), _held_by(heads))  # the planes of the feet's and heads' lines
    walk -= (walk @ up) * up
    length = np.linalg.norm(walk)
    if length < 1e-12:
        raise TooFewTrajectoriesError("track: its feet and heads lie in one plane with the camera")
    walk /= length
    # The way is the one in which the feet come: rays differ along it, seen from above.
    level = feet - np.outer(feet @ up, up)
    if (level[-1] / -(feet[-1] @ up) - level[0] / -(feet[0] @ up)) @ walk < 0:
        walk = -walk
    return np.stack([np.cross(walk, up), walk, up], axis=-1)


def up_of_walkers(intrinsics: Intrinsics, tracks: Sequence[Trajectory]) -> Array:
    """The way up (3,) in the camera frame, of all walkers' verticals and of their horizon.

    Every head over a foot, and every two far places of one walker, is a plane or a direction that
    up lies in or is square to; each counts by a Cauchy weight.

    Raises:
        TooFewTrajectoriesError: fewer than 3 points with a head in all.
    """
    verticals, level, seen = [], [], []
    for track in tracks:
        feet, heads = rays_of(intrinsics, track)
        if len(feet) < _LEAST_POINTS:
            continue
        seen.append((feet, heads))
        verticals.append(_planes(feet, heads))
        level.append(_level_ways(feet, heads))
    if not seen:
        raise TooFewTrajectoriesError(
            f"tracks: {_LEAST_POINTS} points of one with a head are needed, got none"
        )
    feet, heads = (np.concatenate(part) for part in zip(*seen, strict=True))
    kinds = [np.concatenate(verticals), np.concatenate(level)]
    up = _held_by(kinds[0])
    for _ in range(_ROUNDS):
        weighted = []
        for rows in kinds:  # each kind has an error of its own
            if not len(rows):
                continue
            misses = rows @ up
            scale = max(_MAD * float(np.median(np.abs(misses))), 1e-9)
            weights = 1 / (1 + (misses / (_CAUCHY * scale)) ** 2)
            weighted.append(rows * (np.sqrt(weights) / scale)[:, None])
        found = _held_by(np.concatenate(weighted))
        if abs(found @ up) > 1 - 1e-14:
            break
        up = found
    return _upwards(found, feet, heads)


def tilt_and_roll(up: Array) -> tuple[float, float]:
    """Tilt and roll in radians of a camera that sees up (3,) in its own frame."""
    right = np.cross((0.0, 0.0, 1.0), up)
    right /= np.linalg.norm(right)
    ahead = np.cross(up, right)
    # World axes in the camera frame, +Y the way that it looks.
    tilt, roll, _ = angles_from_rotation(np.stack([right, ahead, up], axis=-1))
    return float(tilt), float(roll)


def rays_of(intrinsics: Intrinsics, track: Trajectory) -> tuple[Array, Array]:
    """Directions (N, 3), of length 1, of the feet and heads of the points that have a head."""
    if track.head_uv is None:
        return np.empty((0, 3)), np.empty((0, 3))
    feet, foot_valid = intrinsics.rays(track.uv)
    heads, head_valid = intrinsics.rays(track.head_uv)
    known = foot_valid & head_valid & np.isfinite(track.head_uv).all(axis=1)
    return _unit(feet[known]), _unit(heads[known])


def _planes(feet: Array, heads: Array) -> Array:
    """Normals (N, 3) of the planes through the camera, foot and head; long where those are."""
    return np.cross(feet, heads)


def _held_by(rows: Array) -> Array:
    """The direction (3,) that is squarest to all rows (N, 3): the last right singular vector."""
    return np.asarray(np.linalg.svd(rows, full_matrices=False)[2][-1])


def _level_ways(feet: Array, heads: Array) -> Array:
    """Level directions (M, 3) between places of a walker, the longer the farther those are apart.

    Places nearer to each other than the walker is tall say where noise leads.
    """
    ahead = max(1, round(_APART * len(feet)))
    first, last = slice(None, -ahead), slice(ahead, None)
    on_feet, on_heads = (np.cross(rays[first], rays[last]) for rays in (feet, heads))
    apart = np.linalg.norm(on_feet, axis=1)
    ways = np.cross(on_feet, on_heads)
    lengths = np.linalg.norm(ways, axis=1)
    far = (apart > np.linalg.norm(_planes(feet, heads)[first], axis=1)) & (lengths > 1e-12)
    return np.asarray(ways[far] * (apart[far] / lengths[far])[:, None])


def _upwards(axis: Array, feet: Array, heads: Array) -> Array:
    """An axis (3,) or its opposite: heads are above feet."""
    return axis if ((heads - feet) @ axis).sum() > 0 else -axis


def _unit(rays: Array) -> Array:
    return np.asarray(rays / np.linalg.norm(rays, axis=-1, keepdims=True))
