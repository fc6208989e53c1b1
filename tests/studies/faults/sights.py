"""A level camera 5 m up that looks along +Y, where pixels can be worked out by hand."""

from collections.abc import Sequence

import numpy as np

from models.geometry.ground import pixel_from_ground
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.tracks.scenes import SceneTrack
from models.tracks.trajectory import Trajectory
from studies.faults.view import View

# A foot at (x, y) is at u = 1000 + 1000 x / y and v = 500 + 5000 / y.
LENS = Intrinsics(width=2001, height=1001, fx=1000, fy=1000, cx=1000, cy=500)
POSE = CameraPose(height_m=5.0, tilt_rad=0.0, roll_rad=0.0)


def view_on(places: Sequence[Sequence[float]], end_s: float = 100.0) -> View:
    """The camera, unmoved, before places (N, 2), recorded from 0 s on."""
    return View(
        intrinsics=LENS,
        pose=POSE,
        recorded=POSE,
        places=np.array(places, dtype=np.float64),
        span_s=(0.0, end_s),
    )


def walk(
    name: str, ground: np.ndarray, *, start_s: float = 0.0, step_s: float = 0.1, tall_m: float = 0.0
) -> SceneTrack:
    """Somebody at ground points (N, 2), one each step; with boxes where they are so tall."""
    ground = np.asarray(ground, dtype=np.float64)
    uv, valid = pixel_from_ground(LENS, POSE.rotation, POSE.centre_m, ground)
    assert valid.all()
    assert LENS.contains(uv).all()
    top_v = 500 + 1000 * (5.0 - tall_m) / ground[:, 1] if tall_m else None
    time_s = start_s + step_s * np.arange(len(ground))
    trajectory = Trajectory(time_s=time_s, uv=uv, top_v=top_v)
    return SceneTrack(track_id=name, trajectory=trajectory, person_id=name)


def straight(begin: Sequence[float], end: Sequence[float], count: int) -> np.ndarray:
    """So many points (N, 2) on a straight line."""
    return np.linspace(np.array(begin, dtype=np.float64), np.array(end, dtype=np.float64), count)


def places_of(track: SceneTrack) -> np.ndarray:
    """Ground points (N, 2) by hand: y = 5000 / (v - 500), x = (u - 1000) y / 1000."""
    u, v = track.trajectory.uv.T
    y = 5000 / (v - 500)
    return np.stack([(u - 1000) * y / 1000, y], axis=1)
