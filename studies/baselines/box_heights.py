"""A peer: cameratransform fitted to how tall boxes are, as its documentation shows.

Optional: `pip install surefoot[peers]` (Gerum et al. 2019; MIT). Its default optimiser returns its
start; Nelder and Mead's, within bounds, works.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from models.errors import ShapeError, TooFewTrajectoriesError
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array
from models.tracks.trajectory import Trajectory
from studies.plane_estimate import PlaneEstimate

_MOST_OF_A_TRACK = 10
_FEWEST_POINTS = 10
_REACH_DEG, _REACH_SHARE = 30.0, 2.0  # of the bounds, either way
_STEPS = np.array([0.02, 0.02, 0.002])  # degrees, degrees, log height: of second differences


@dataclass(frozen=True, slots=True, kw_only=True)
class Statures:
    """Distribution of people's statures, in metres."""

    mean_m: float = 1.75
    sd_m: float = 0.1


def pose_by_box_heights(
    intrinsics: Intrinsics,
    tracks: Sequence[Trajectory],
    prior: CameraPose,
    statures: Statures | None = None,
) -> PlaneEstimate:
    """Tilt, roll and log height at which boxes are as tall as people are; from the prior pose on.

    The covariance is that of its own likelihood, to which every box is a draw of its own.

    Raises:
        ShapeError: cameratransform is not installed.
        TooFewTrajectoriesError: fewer than 10 points with a box.
    """
    try:
        import cameratransform
    except ImportError as error:
        raise ShapeError(
            "cameratransform: is not installed; pip install 'surefoot[peers]'"
        ) from error
    feet, tops = _feet_and_tops(intrinsics, tracks)
    if len(feet) < _FEWEST_POINTS:
        raise TooFewTrajectoriesError(
            f"tracks: {_FEWEST_POINTS} points with a box or a head are needed, got {len(feet)}"
        )
    statures = statures or Statures()
    start = np.array(
        [math.degrees(prior.tilt_rad), math.degrees(prior.roll_rad), math.log(prior.height_m)]
    )
    camera = _camera(cameratransform, intrinsics)
    camera.addObjectHeightInformation(feet, tops, statures.mean_m, statures.sd_m)
    width = np.array([_REACH_DEG, _REACH_DEG, math.log(_REACH_SHARE)])
    low, high = start - width, start + width
    names = ("tilt_deg", "roll_deg", "elevation_m")
    bounds = _theirs(low), _theirs(high)
    fitted = [
        cameratransform.FitParameter(
            name, lower=min(one, other), upper=max(one, other), value=value
        )
        for name, one, other, value in zip(names, *bounds, _theirs(start), strict=True)
    ]
    camera.fit(fitted, method="Nelder-Mead")
    found = _ours(camera)

    def likely(at: Array) -> float:
        camera.tilt_deg, camera.roll_deg, camera.elevation_m = _theirs(at)
        return float(camera.getLogProbability())

    covariance = np.linalg.pinv(_curvature(likely, found))
    to_rad = np.radians([1.0, 1.0, math.degrees(1.0)])
    return PlaneEstimate(
        values=found * to_rad,
        covariance=covariance * np.outer(to_rad, to_rad),
        tracks=len(tracks),
    )


def _camera(cameratransform: Any, intrinsics: Intrinsics) -> Any:
    """Its camera of our lens without distortion: points are given to it undistorted."""
    projection = cameratransform.RectilinearProjection(
        focallength_x_px=intrinsics.fx,
        focallength_y_px=intrinsics.fy,
        center_x_px=intrinsics.cx,
        center_y_px=intrinsics.cy,
        image_width_px=intrinsics.width,
        image_height_px=intrinsics.height,
    )
    camera = cameratransform.Camera(projection, cameratransform.SpatialOrientation())
    # It finds a head over its foot along both of the world's axes; what lies right ahead along one
    # has no answer by the other. The heading is ours to choose: between them.
    camera.heading_deg = 45.0
    return camera


def _theirs(at: Array) -> tuple[float, float, float]:
    """Its tilt (0 straight down), roll (ours the other way) and height, of what is ours."""
    return 90.0 - float(at[0]), -float(at[1]), math.exp(at[2])


def _ours(camera: Any) -> Array:
    """Tilt and roll in degrees, and log height."""
    return np.array(
        [90.0 - camera.tilt_deg, -camera.roll_deg, math.log(max(camera.elevation_m, 1e-3))]
    )


def _feet_and_tops(intrinsics: Intrinsics, tracks: Sequence[Trajectory]) -> tuple[Array, Array]:
    """Undistorted pixels (N, 2) of feet and of heads: where none were seen, of boxes' tops."""
    feet, tops = [np.empty((0, 2))], [np.empty((0, 2))]
    for track in tracks:
        heads = track.head_uv
        if heads is None and track.top_v is not None:
            heads = np.stack([track.uv[:, 0], track.top_v], axis=1)
        if heads is None:
            continue
        known = np.flatnonzero(np.isfinite(heads).all(axis=1))
        known = known[:: max(1, -(-known.size // _MOST_OF_A_TRACK))]
        feet.append(track.uv[known])
        tops.append(heads[known])
    both = []
    for points in (feet, tops):
        rays, _ = intrinsics.rays(np.concatenate(points))
        both.append(rays[:, :2] * (intrinsics.fx, intrinsics.fy) + (intrinsics.cx, intrinsics.cy))
    valid = np.isfinite(both[0]).all(axis=1) & np.isfinite(both[1]).all(axis=1)
    return both[0][valid], both[1][valid]


def _curvature(likely: Any, at: Array) -> Array:
    """Minus the second differences (3, 3) of a log likelihood."""
    matrix = np.empty((3, 3))
    for row in range(3):
        for column in range(3):
            one, other = _STEPS * np.eye(3)[row], _STEPS * np.eye(3)[column]
            corners = (
                likely(at + one + other)
                - likely(at + one - other)
                - likely(at - one + other)
                + likely(at - one - other)
            )
            matrix[row, column] = -corners / (4 * _STEPS[row] * _STEPS[column])
    return matrix
