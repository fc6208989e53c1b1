"""What the set network reads of one window: its place, pace and course on the ground.

Numpy only.
"""

import math

import numpy as np

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array, Mask, rotation_from_angles
from models.trajectory import Windows

FEATURES = 22
MIRRORED = (0, 2, 5, 12, 14, 16)  # columns that change sign where right and left are exchanged
_NODES = 5
_DEGREE = 3
_LOWEST = 0.02  # tangent below the horizon: what would walk farther than 50 heights is held there
_LEAST_PACE = 0.02  # of the assumed speed
_PACE, _STRAIGHT = 10, 13  # columns
_PACE_RATIO = math.log(5)  # from the usual pace: who goes slower stands
_STRAIGHT_ENOUGH = 0.8


def window_features(
    windows: Windows,
    intrinsics: Intrinsics,
    pose: CameraPose,
    prior: CameraPose,
    speed_mps: float | Array,
    step_s: float,
) -> Array:
    """Features (B, 22) of windows: small and smooth in the pose, 0 where nothing is odd.

    A cubic through each window takes out noise; its five equally spaced nodes are put on the
    ground of the prior pose. Where that pose is wrong, walkers change pace with place and course.
    """
    if not len(windows):
        return np.empty((0, FEATURES))
    nodes_uv, residual_px = _nodes(windows)
    ground, aside, below = _ground(nodes_uv, intrinsics, pose, prior)  # (B, 5, 2) in prior heights
    moves = np.diff(ground, axis=1)
    duration_s = (windows.lengths - 1) * step_s
    expected = speed_mps * duration_s / (_NODES - 1) / prior.height_m
    pace = np.log(np.linalg.norm(moves, axis=-1) / expected[:, None] + _LEAST_PACE)
    whole = ground[:, -1] - ground[:, 0]
    whole_length = np.linalg.norm(whole, axis=-1)
    course = np.arctan2(whole[:, 0], whole[:, 1])
    halves = ground[:, 2] - ground[:, 0], ground[:, 4] - ground[:, 2]
    turn = (halves[0][:, 0] * halves[1][:, 1] - halves[0][:, 1] * halves[1][:, 0]) / (
        np.linalg.norm(halves[0], axis=-1) * np.linalg.norm(halves[1], axis=-1) + 1e-6
    )
    straight = whole_length / (np.linalg.norm(moves, axis=-1).sum(1) + 1e-6)
    middle = ground[:, 2]
    view = max(intrinsics.width / intrinsics.fx, intrinsics.height / intrinsics.fy)
    columns = [
        aside[:, 2] / view,
        (below[:, 2] - math.tan(prior.tilt_rad)) / view,
        (aside[:, -1] - aside[:, 0]) / view,
        (below[:, -1] - below[:, 0]) / view,
        np.log(np.linalg.norm(middle, axis=-1)),
        np.arctan2(middle[:, 0], middle[:, 1]),
        *np.clip(pace, -3, 3).T,
        np.clip(np.log(whole_length / (4 * expected) + _LEAST_PACE), -3, 3),
        np.clip(np.log(ground[:, -1, 1] / ground[:, 0, 1]), -3, 3),
        np.clip(turn, -1, 1),
        straight,
        np.sin(course),
        np.cos(course),
        np.sin(2 * course),
        np.cos(2 * course),
        np.log(duration_s),
        windows.lengths / 31 - 0.5,
        np.log(residual_px / intrinsics.width * 1920 + 0.3),
        np.log(np.linalg.norm(nodes_uv[:, -1] - nodes_uv[:, 0], axis=-1) / intrinsics.width + 1e-3),
    ]
    return np.stack(columns, axis=-1)


def walking(features: Array, there: Mask) -> Mask:
    """Which windows (S, W) of sets show people who walk: none who stand, dawdle, run or stray.

    The way covered has to be long enough for its time, by the median of the brisker half of its
    set, and straight. `there` (S, W) tells the windows of each set from padding.
    """
    pace = np.where(there, features[..., _PACE], np.nan)
    kept = np.zeros_like(there)
    some = there.any(-1)
    middle = np.nanmedian(pace[some], axis=-1, keepdims=True)
    brisk = np.nanmedian(np.where(pace[some] >= middle, pace[some], np.nan), axis=-1, keepdims=True)
    usual = np.abs(pace[some] - brisk) < _PACE_RATIO
    kept[some] = usual & (features[some][..., _STRAIGHT] > _STRAIGHT_ENOUGH)
    return kept & there


def usual_speeds(features: Array, there: Mask, speed_mps: float) -> Array:
    """The median speed (S,) of those who walk in each set, seen from the prior pose.

    `features` (S, W, F) are those for an assumed speed, which is answered where nobody walks.
    """
    pace = np.where(walking(features, there), features[..., _PACE], np.nan)
    some = np.isfinite(pace).any(-1)
    speeds = np.full(len(features), speed_mps)
    speeds[some] = speed_mps * (np.exp(np.nanmedian(pace[some], axis=-1)) - _LEAST_PACE)
    return speeds


def _ground(
    nodes_uv: Array, intrinsics: Intrinsics, pose: CameraPose, prior: CameraPose
) -> tuple[Array, Array, Array]:
    """Ground of pixels seen from a pose, in heights of the prior pose, and where it would see them.

    Returns the points (B, N, 2), aside and ahead, and their tangents aside of and below the
    forward horizon (B, N) as seen from the prior pose's height.
    """
    rays, _ = intrinsics.rays(nodes_uv)
    level = np.nan_to_num(rays) @ rotation_from_angles(pose.tilt_rad, pose.roll_rad, 0.0)
    ahead = np.maximum(level[..., 1], 0.05)  # heading 0 looks along +Y
    share = prior.height_m / pose.height_m
    aside, below = level[..., 0] / ahead, -level[..., 2] / ahead * share
    # Under `_LOWEST`, ever closer to half of it, so that order is kept.
    floor = _LOWEST / 2
    safe = np.where(
        below > _LOWEST, below, floor + floor * np.exp(np.minimum((below - _LOWEST) / floor, 0.0))
    )
    return np.stack([aside / safe, 1 / safe], axis=-1), aside, below


def _nodes(windows: Windows) -> tuple[Array, Array]:
    """Pixels (B, 5, 2) of a cubic at equal times, and what it leaves over (B,), in pixels."""
    nodes = np.empty((len(windows), _NODES, 2))
    residual = np.empty(len(windows))
    for length in np.unique(windows.lengths):
        rows = np.flatnonzero(windows.lengths == length)
        uv = windows.uv[rows, :length]
        times = np.linspace(-1, 1, length)
        basis = np.polynomial.legendre.legvander(times, _DEGREE)
        fit = np.linalg.pinv(basis) @ uv  # (rows, 4, 2)
        nodes[rows] = np.polynomial.legendre.legvander(np.linspace(-1, 1, _NODES), _DEGREE) @ fit
        residual[rows] = np.sqrt(np.square(uv - basis @ fit).sum(-1).mean(-1))
    return nodes, residual
