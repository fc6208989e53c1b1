"""Between pixels and the ground plane Z = 0, for one camera pose or many at once.

Places are in metres of the world where a camera stands by its centre; else they are in camera
heights, relative to the camera's foot point, axes as the world's.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from models.compiled import compiled
from models.errors import ShapeError
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array, Mask, norm, rotation_and_derivatives

# Of the angle below the horizon: 0.3 deg, 200 camera heights away. A pixel of a street camera is
# 0.05 deg, so that one of noise there moves a place by a fifth of its distance; nearer to the
# horizon a place is noise, and its derivatives, which estimators follow, are more so.
LOWEST_SINE = 5e-3


def pixel_from_ground(
    intrinsics: Intrinsics, rotation: Array, centre_m: Array, ground_m: Array
) -> tuple[Array, Mask]:
    """Pixels (..., N, 2) of ground points (..., N, 2), and which are valid (..., N).

    `rotation` (..., 3, 3) is `camera_from_world`, `centre_m` (..., 3) the camera's in the world.

    Points behind the camera or folded back by the distortion are NaN and not valid; valid points
    may lie outside the image.
    """
    from_centre = np.concatenate(
        [
            ground_m - centre_m[..., None, :2],
            np.broadcast_to(-centre_m[..., None, 2:], (*ground_m.shape[:-1], 1)),
        ],
        axis=-1,
    )
    return intrinsics.project(from_centre @ np.swapaxes(rotation, -1, -2))


def ground_from_pixel(
    intrinsics: Intrinsics, rotation: Array, centre_m: Array, uv: Array
) -> tuple[Array, Mask]:
    """Ground points x, y (..., N, 2) in metres of pixels (..., N, 2), and which are valid.

    A pixel that is not clearly below the horizon, or that no ray reaches, is NaN and not valid.
    Shapes as in `pixel_from_ground`, whose inverse this is.
    """
    rays, known = intrinsics.rays(uv)
    world, down, below = _falling(rays, rotation)
    hits = known & below
    scale = centre_m[..., None, 2] / down
    ground = centre_m[..., None, :2] + scale[..., None] * world[..., :2]
    return np.where(hits[..., None], ground, np.nan), hits


def ground_of_rays(rays: Array, rotation: Array, beyond: float = np.nan) -> tuple[Array, Mask]:
    """Ground points (..., N, 2) of rays (..., N, 3) of the camera frame, and which are valid.

    In camera heights from the camera's foot, axes as the world's. What is not valid is `beyond`,
    which is 0 for those whose sums over all rays have to stay finite.
    """
    world, down, valid = _falling(rays, rotation)
    return np.where(valid[..., None], world[..., :2] / down[..., None], beyond), valid


def _falling(rays: Array, rotation: Array) -> tuple[Array, Array, Mask]:
    """World directions (..., N, 3) of rays, how far they fall (..., N), and which hit the ground.

    A ray less than 0.3 deg below the horizon hits none that is worth anything; 1 stands for how
    far it falls.
    """
    world = rays @ rotation  # rows are points: (R.T @ ray).T
    down = -world[..., 2]
    valid = down > LOWEST_SINE * norm(world)
    return world, np.where(valid, down, 1.0), valid


class Landing(NamedTuple):
    """Ground point of a ray, `x` and `y`; both are 0 where it is not `valid`."""

    x: float
    y: float
    valid: bool


@compiled
def landing(rays: Array, number: int, rotation: Array) -> Landing:
    """Ground point of one of camera-frame rays (M, 3); `rotation` (3, 3) `camera_from_world`."""
    ray_x, ray_y, ray_z = rays[number, 0], rays[number, 1], rays[number, 2]
    x = ray_x * rotation[0, 0] + ray_y * rotation[1, 0] + ray_z * rotation[2, 0]
    y = ray_x * rotation[0, 1] + ray_y * rotation[1, 1] + ray_z * rotation[2, 1]
    down = -(ray_x * rotation[0, 2] + ray_y * rotation[1, 2] + ray_z * rotation[2, 2])
    if down > LOWEST_SINE * math.sqrt(x * x + y * y + down * down):
        heights = 1 / down
        return Landing(x * heights, y * heights, True)
    return Landing(0.0, 0.0, False)


class GroundFlow(NamedTuple):
    """Velocity of one ground point, `x` and `y`, and the share `fall` that its ray falls."""

    x: float
    y: float
    fall: float


def rotation_and_turns(tilt_rad: float, roll_rad: float, heading_rad: float) -> tuple[Array, Array]:
    """The rotation (3, 3), and turns T (2, 3, 3) of tilt and roll: a direction w moves by w T."""
    rotation, derivatives = rotation_and_derivatives(tilt_rad, roll_rad, heading_rad)
    return rotation, np.array([rotation.T @ turned for turned in derivatives])


@compiled
def ground_flow(x: float, y: float, turn: Array) -> GroundFlow:
    """Velocity of a ground point under a turn (3, 3).

    It is g = w_xy / -w_z of its ray's direction w; w changes by w T, and w_z by that share of
    itself, with the sign turned.
    """
    fall = x * turn[0, 2] + y * turn[1, 2] - turn[2, 2]
    return GroundFlow(
        x * turn[0, 0] + y * turn[1, 0] - turn[2, 0] + x * fall,
        x * turn[0, 1] + y * turn[1, 1] - turn[2, 1] + y * fall,
        fall,
    )


_POINTS = 721  # every half degree around


def horizon_pixels(
    intrinsics: Intrinsics, pose: CameraPose, points: int = _POINTS
) -> tuple[Array, Mask]:
    """Pixels (N, 2) of the level directions all around, and which are valid (N,).

    They begin and end behind the camera and run clockwise as seen from above: from left to right
    in the picture of an upright camera. Valid ones may lie outside the picture, others are NaN.

    A level camera without distortion has its horizon on the line v = cy - fy tan(tilt): above
    the middle where it looks down.
    """
    azimuth = pose.heading_rad + np.linspace(-np.pi, np.pi, points)
    level = np.stack([np.sin(azimuth), np.cos(azimuth), np.zeros(points)], axis=-1)
    return intrinsics.project(level @ pose.rotation.T)


def ground_share(intrinsics: Intrinsics, pose: CameraPose, across: int = 33) -> float:
    """Share of the picture that shows ground rather than sky, of a lattice of its pixels."""
    _, hits = ground_from_pixel(
        intrinsics, pose.rotation, pose.centre_m, picture_lattice(intrinsics, across)
    )
    return float(hits.mean())


def picture_lattice(intrinsics: Intrinsics, across: int) -> Array:
    """Pixels (across^2, 2) evenly over the picture, its corners among them."""
    u = np.linspace(-0.5, intrinsics.width - 0.5, across)
    v = np.linspace(-0.5, intrinsics.height - 0.5, across)
    return np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)


_STRIDE_S = 2.0  # a box jitters from frame to frame; over two steps it hardly does


def walking_speed(
    intrinsics: Intrinsics, pose: CameraPose, tracks: Sequence[tuple[Array, Array]]
) -> float:
    """The speed in m/s at which half of all ground is covered; NaN where nobody covers any.

    By distance rather than by time, people who stand and wait do not count as slow walkers.

    `tracks` has increasing times (N,) and pixels of the foot (N, 2) of each person.
    """
    found = [_strides(intrinsics, pose, time_s, uv) for time_s, uv in tracks]
    steps, times = np.concatenate([np.zeros((2, 0)), *found], axis=1)
    if not steps.sum() > 0:
        return math.nan
    speeds = steps / times
    order = np.argsort(speeds)
    covered = np.cumsum(steps[order])
    return float(speeds[order][np.searchsorted(covered, covered[-1] / 2)])


def _strides(intrinsics: Intrinsics, pose: CameraPose, time_s: Array, uv: Array) -> Array:
    """Metres and seconds (2, M) of the strides of a person that are on the ground."""
    ground, hits = ground_from_pixel(intrinsics, pose.rotation, pose.centre_m, uv)
    ends = np.searchsorted(time_s, time_s + _STRIDE_S)
    starts = np.flatnonzero(ends < len(time_s))
    ends = ends[starts]
    known = hits[starts] & hits[ends]
    starts, ends = starts[known], ends[known]
    steps = np.hypot(*(ground[ends] - ground[starts]).T)
    return np.stack([steps, time_s[ends] - time_s[starts]])


@dataclass(frozen=True, slots=True, kw_only=True)
class Misplacement:
    """Error in the place of a person who stands at a distance from the camera's foot.

    `off_m` and `placed_m` are None where the wrong pose takes the person to be above its horizon,
    which is nowhere. `farther_m` is how much of it is along the line of sight, positive away from
    the camera. Places are x and y in the world.
    """

    distance_m: float
    off_m: float | None
    farther_m: float | None
    stands_m: tuple[float, float]
    placed_m: tuple[float, float] | None


def misplacements(
    intrinsics: Intrinsics, true: CameraPose, believed: CameraPose, distances_m: Sequence[float]
) -> tuple[Misplacement, ...]:
    """Errors in the places of people straight ahead, of a believed pose while another one is true.

    A person stands at each distance from the point below the camera, in the direction that the
    true optical axis has on the ground. What the true camera sees there is put back on the ground
    by the believed one. Distances that are not in the picture are left out.

    Pin: a camera 10 m high that looks down by 45 deg sees a person at 10 m in its middle; one that
    is believed to look down by 40 deg puts that middle at 10 / tan 40 deg = 11.92 m.

    Raises:
        ShapeError: a distance is not above 0.
    """
    if any(not distance > 0 for distance in distances_m):
        raise ShapeError(f"distances_m: must be above 0, got {list(distances_m)}")
    away = np.array([math.sin(true.heading_rad), math.cos(true.heading_rad)])
    stands = true.centre_m[:2] + np.outer(np.asarray(distances_m, dtype=np.float64), away)
    uv, _ = pixel_from_ground(intrinsics, true.rotation, true.centre_m, stands)
    placed, hit = ground_from_pixel(intrinsics, believed.rotation, believed.centre_m, uv)
    off = placed - stands
    return tuple(
        Misplacement(
            distance_m=float(distance),
            off_m=float(np.linalg.norm(step)) if lands else None,
            farther_m=float(step @ away) if lands else None,
            stands_m=(float(stand[0]), float(stand[1])),
            placed_m=(float(stand[0] + step[0]), float(stand[1] + step[1])) if lands else None,
        )
        for distance, stand, step, lands, seen in zip(
            distances_m, stands, off, hit, intrinsics.contains(uv), strict=True
        )
        if seen
    )
