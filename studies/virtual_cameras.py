"""Cameras that were never there, before people who were followed on the ground."""

import math

import numpy as np

from models.errors import DegenerateGeometryError
from models.geometry.ground import LOWEST_SINE, pixel_from_ground
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array, Mask
from models.tracks.scenes import SceneTrack
from models.tracks.trajectory import Trajectory

_HEIGHT_M = (3.0, 8.0)
_TILT_DEG = (14.0, 35.0)
_ROLL_DEG = 2.0
_AWAY_M = (6.0, 16.0)  # from what it looks at
_SEEN_SHARE = 0.15  # of all points, at least
_MOST_DRAWS = 500


def draw_cameras(
    lens: Intrinsics, like: CameraPose, places: Array, reach_m: float, count: int
) -> list[CameraPose]:
    """Poses that look at places (N, 2) where people are, each another way; always the same ones.

    Raises:
        DegenerateGeometryError: hardly anybody is seen from any that is drawn.
    """
    rng = np.random.default_rng(0)
    some = places[:: max(1, len(places) // 20_000)]
    poses = [like]
    for _ in range(_MOST_DRAWS):
        if len(poses) > count:
            return poses[1:]
        towards = rng.uniform(0, 2 * math.pi)
        looked_at = some[rng.integers(len(some))]
        away = rng.uniform(*_AWAY_M)
        pose = CameraPose(
            height_m=float(rng.uniform(*_HEIGHT_M)),
            tilt_rad=math.radians(rng.uniform(*_TILT_DEG)),
            roll_rad=math.radians(rng.uniform(-_ROLL_DEG, _ROLL_DEG)),
            heading_rad=float(towards),
            x_m=float(looked_at[0] - away * math.sin(towards)),
            y_m=float(looked_at[1] - away * math.cos(towards)),
        )
        uv, near = _pixels(lens, pose, some, reach_m)
        apart = min(
            abs(math.remainder(pose.heading_rad - other.heading_rad, 2 * math.pi))
            for other in poses
        )
        if apart > math.radians(30) and (near & lens.contains(uv)).mean() > _SEEN_SHARE:
            poses.append(pose)
    raise DegenerateGeometryError(
        f"cameras: {len(poses) - 1} of {count} see people in {_MOST_DRAWS} draws"
    )


def seen_by(
    lens: Intrinsics, pose: CameraPose, rows: Array, reach_m: float
) -> tuple[SceneTrack, ...]:
    """The tracks by their first times of rows (N, 4) of track, time, x and y, by track and time.

    Pixels go on beyond the picture, so that a move of the camera can bring people into it; what is
    farther than `reach_m` or behind the camera is left out, and what comes after it.
    """
    uv, there = _pixels(lens, pose, rows[:, 2:4], reach_m)
    again = np.diff(rows[:, 0], prepend=np.nan) != 0
    starts = np.flatnonzero(again | np.diff(there, prepend=False))
    tracks: dict[str, SceneTrack] = {}
    for begin, end in zip(starts, np.append(starts[1:], len(rows)), strict=True):
        if not there[begin] or end - begin < 2:
            continue
        time_s = rows[begin:end, 1]
        kept = begin + np.flatnonzero(np.diff(time_s, prepend=-np.inf) > 0)
        name = str(int(rows[begin, 0]))
        before = tracks.get(name)
        if before is None or before.trajectory.time_s.size < kept.size:
            trajectory = Trajectory(time_s=rows[kept, 1], uv=uv[kept])
            tracks[name] = SceneTrack(track_id=name, trajectory=trajectory, person_id=name)
    return tuple(sorted(tracks.values(), key=lambda track: float(track.trajectory.time_s[0])))


def _pixels(
    lens: Intrinsics, pose: CameraPose, ground: Array, reach_m: float
) -> tuple[Array, Mask]:
    """Pixels (N, 2) of ground points, and which are in front of the camera and within reach."""
    uv, valid = pixel_from_ground(lens, pose.rotation, pose.centre_m, ground)
    away = np.linalg.norm(ground - pose.centre_m[:2], axis=1)
    above = pose.height_m > 2 * LOWEST_SINE * np.hypot(away, pose.height_m)
    return uv, valid & above & (away <= reach_m)
