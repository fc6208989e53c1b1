"""Camera poses around a prior pose, sets of them as arrays, and what is seen after a move."""

import math
from dataclasses import dataclass, replace

import numpy as np

from models.geometry.ground import ground_from_pixel, pixel_from_ground
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array, Index, rotation_from_angles
from models.geometry.upright import heads_above, heads_seen, statures, tops_seen
from models.rows import rows_of
from models.tracks.trajectory import Trajectory


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseRange:
    """Spread and fineness of poses around the prior pose."""

    height_m: float = 3.0
    height_step_m: float = 0.4
    angle_rad: float = math.radians(15)
    angle_step_rad: float = math.radians(2)
    lowest_m: float = 0.5  # the paper's max(0, h - 3 m), kept clear of the ground itself


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseSet:
    """P poses that share x, y and heading; `height_m`, `tilt_rad`, `roll_rad` are (P,)."""

    height_m: Array
    tilt_rad: Array
    roll_rad: Array
    heading_rad: float
    x_m: float
    y_m: float

    def __len__(self) -> int:
        return int(self.height_m.size)

    def take(self, indices: Index) -> "PoseSet":
        """The poses at the given places, in that order."""
        return rows_of(self, indices)

    @property
    def rotation(self) -> Array:
        """Rotations `camera_from_world` (P, 3, 3)."""
        return rotation_from_angles(self.tilt_rad, self.roll_rad, self.heading_rad)

    @property
    def centre_m(self) -> Array:
        """Camera centres in the world (P, 3)."""
        return np.stack(
            np.broadcast_arrays(np.float64(self.x_m), np.float64(self.y_m), self.height_m), axis=-1
        )


def grid_poses(prior: CameraPose, spread: PoseRange) -> PoseSet:
    """The paper's grid: every combination of height, tilt and roll around the prior pose.

    Each axis runs from its lower end in equal steps. With the paper's numbers that is 16 x 16 x 16
    poses and the prior pose itself is not one of them.

    Source: Xu et al. 2020, section 4.1 ("min" is printed for the lower end of the height; a camera
    is above the ground, so max is meant).
    """
    lowest = max(spread.lowest_m, prior.height_m - spread.height_m)
    heights = _steps(lowest, prior.height_m + spread.height_m, spread.height_step_m)
    offsets = _steps(-spread.angle_rad, spread.angle_rad, spread.angle_step_rad)
    grid = np.meshgrid(heights, prior.tilt_rad + offsets, prior.roll_rad + offsets, indexing="ij")
    height, tilt, roll = (axis.ravel() for axis in grid)
    return _around(prior, height, tilt, roll)


def random_poses(
    prior: CameraPose, spread: PoseRange, count: int, rng: np.random.Generator
) -> PoseSet:
    """Poses drawn evenly over the same range as the grid's."""
    lowest = max(spread.lowest_m, prior.height_m - spread.height_m)
    tilt, roll = rng.uniform(-spread.angle_rad, spread.angle_rad, (2, count))
    height = rng.uniform(lowest, prior.height_m + spread.height_m, count)
    return _around(prior, height, prior.tilt_rad + tilt, prior.roll_rad + roll)


def repeated_pose(pose: CameraPose, count: int) -> PoseSet:
    """One pose, so many times: a camera that stays while people come."""
    return _around(
        pose,
        np.full(count, pose.height_m),
        np.full(count, pose.tilt_rad),
        np.full(count, pose.roll_rad),
    )


def _around(prior: CameraPose, height: Array, tilt: Array, roll: Array) -> PoseSet:
    return PoseSet(
        height_m=height,
        tilt_rad=np.clip(tilt, -math.pi / 2, math.pi / 2),
        roll_rad=roll,
        heading_rad=prior.heading_rad,
        x_m=prior.x_m,
        y_m=prior.y_m,
    )


def _steps(low: float, high: float, step: float) -> Array:
    return np.asarray(low + step * np.arange(math.floor((high - low) / step + 1e-9) + 1))


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
