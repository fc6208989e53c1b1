"""A move of a camera, and what it sees of the same people afterwards."""

import math
from dataclasses import dataclass, replace

import numpy as np

from models.geometry.ground import ground_from_pixel, pixel_from_ground
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.upright import heads_above, heads_seen, statures, tops_seen
from models.tracks.trajectory import Trajectory


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseOffset:
    """A move of the camera: radians of tilt, roll, heading, and the log of the height ratio."""

    tilt_rad: float = 0.0
    roll_rad: float = 0.0
    log_height: float = 0.0
    heading_rad: float = 0.0

    def apply(self, pose: CameraPose) -> CameraPose:
        """The pose after the move."""
        return replace(
            pose,
            height_m=pose.height_m * math.exp(self.log_height),
            tilt_rad=pose.tilt_rad + self.tilt_rad,
            roll_rad=pose.roll_rad + self.roll_rad,
            heading_rad=pose.heading_rad + self.heading_rad,
        )


def offset_trajectory(
    trajectory: Trajectory, intrinsics: Intrinsics, pose: CameraPose, moved: CameraPose
) -> Trajectory | None:
    """Trajectory of the same people after a move of the camera; the longest run inside the image.

    None where fewer than two points stay in the picture. Exact for the feet, which lie on the
    ground; the boxes' upper edges are those of upright people of the same height. Heads lean as
    they did, to the side.
    """
    ground, on_ground = ground_from_pixel(intrinsics, pose.rotation, pose.centre_m, trajectory.uv)
    uv, _ = pixel_from_ground(intrinsics, moved.rotation, moved.centre_m, ground)
    seen = on_ground & intrinsics.contains(uv)
    runs = np.split(np.arange(seen.size), np.flatnonzero(np.diff(seen)) + 1)
    longest = max((run for run in runs if seen[run[0]]), key=len, default=np.arange(0))
    if longest.size < 2:
        return None
    top_v = None
    if trajectory.top_v is not None:
        tall, _ = statures(
            intrinsics, pose.rotation, pose.height_m, trajectory.uv, trajectory.top_v
        )
        top_v = tops_seen(intrinsics, moved.rotation, moved.centre_m, ground, tall)
        top_v = top_v[longest]
    head_uv = None
    if trajectory.head_uv is not None:
        heads_m = heads_above(intrinsics, pose, ground, trajectory.head_uv)
        head_uv = heads_seen(intrinsics, moved, heads_m)[longest]
    # What is behind the camera now has no pixels.
    return replace(trajectory.part(longest), uv=uv[longest], top_v=top_v, head_uv=head_uv)
