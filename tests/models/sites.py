"""Simulated sites whose camera was knocked, for tests of the joint estimator."""

import math
from dataclasses import replace

import numpy as np

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.simulation.poses import PoseOffset
from models.tracks.observations import Observations
from models.tracks.trajectory import Trajectory
from models.tracks.walks import observe_each
from studies.simulation.lanes import SiteConfig, draw_lanes, walk_site

LENS = Intrinsics(width=1280, height=720, fx=1100, fy=1100, cx=639.5, cy=359.5)
PRIOR = CameraPose(height_m=6.0, tilt_rad=math.radians(18), roll_rad=math.radians(1))
KNOCKED = PoseOffset(
    tilt_rad=math.radians(5), roll_rad=math.radians(-4), log_height=math.log(1.08)
).apply(PRIOR)  # fmt: skip


def tracks_of(
    seed: int,
    *views: tuple[CameraPose, int],
    config: SiteConfig | None = None,
    boxes: bool = False,
) -> list[list[Trajectory]]:
    """The tracks of one site's people, so many as each pose sees."""
    rng = np.random.default_rng(seed)
    config = config or SiteConfig()
    lanes = draw_lanes(LENS, PRIOR, config, rng)
    found = []
    start_s = 0.0
    for pose, count in views:
        tracks = walk_site(LENS, pose, lanes, config, count, rng)
        tracks = [
            replace(t, time_s=t.time_s + start_s, top_v=t.top_v if boxes else None) for t in tracks
        ]
        start_s = float(tracks[-1].time_s[-1]) + 20
        found.append(tracks)
    return found


def seen(tracks: list[Trajectory]) -> Observations:
    """What the joint estimator reads of tracks."""
    return observe_each(tracks, LENS)


def near(pose: CameraPose) -> np.ndarray:
    """Tilt, roll in degrees and the height in metres of a pose."""
    return np.array([math.degrees(pose.tilt_rad), math.degrees(pose.roll_rad), pose.height_m])
