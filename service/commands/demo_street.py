"""The street of the demo: its camera, the knock, and the people who walk there."""

import math
from dataclasses import asdict
from typing import Any

import numpy as np

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.simulation.pose_offset import PoseOffset
from models.simulation.poses import repeated_pose
from models.simulation.walkers import WalkConfig, simulate_walks
from models.tracks.scenes import SceneTrack
from models.tracks.trajectory import Trajectory
from service.formats.degrees import in_degrees

CAMERA_ID = "demo-street"
LENS = Intrinsics(width=1280, height=720, fx=1100, fy=1100, cx=639.5, cy=359.5)
PRIOR = CameraPose(height_m=6.0, tilt_rad=math.radians(22), roll_rad=math.radians(1))
KNOCK = PoseOffset(tilt_rad=math.radians(6), roll_rad=math.radians(-5))
REFERENCE_TRACKS, STILL_TRACKS, KNOCKED_TRACKS = 100, 50, 100
BETWEEN_S = 6.0  # of the street's time; the recording ends now


def street_people(pose: CameraPose, count: int, seed: int) -> list[SceneTrack]:
    """People seen by a camera, whose walks end one after the other from time 0 on."""
    rng = np.random.default_rng(seed)
    walk = WalkConfig(speed_sd_mps=0.2, farthest_m=40.0)
    walks = simulate_walks(LENS, repeated_pose(pose, count), walk, rng)
    tracks = []
    for number, (uv, length) in enumerate(zip(walks.uv, walks.lengths, strict=True)):
        time_s = BETWEEN_S * (number + 1) + (np.arange(length) - length + 1) * walk.step_s
        noisy = uv[:length] + rng.normal(0, 1.5, (length, 2))
        tracks.append(
            SceneTrack(track_id=f"{seed}-{number}", trajectory=Trajectory(time_s=time_s, uv=noisy))
        )
    return tracks


def camera_body() -> dict[str, Any]:
    """The body that registers the camera."""
    return {
        "id": CAMERA_ID,
        "name": "Demo street",
        "intrinsics": {name: getattr(LENS, name) for name in
                       ("width", "height", "fx", "fy", "cx", "cy")},
        "prior_pose": in_degrees(asdict(PRIOR)),
        "reference_tracks": REFERENCE_TRACKS,
    }  # fmt: skip
