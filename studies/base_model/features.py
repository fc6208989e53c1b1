"""Features of a segment of a walk for the base model: place, course, pace, alike for all cameras.

Points of the ground are in heights of the pose that is looked from, paces in assumed walking
speeds, noise in angles: no pixel, metre or focal length is left. Numpy only.
"""

import numpy as np

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array, Mask
from studies.base_model.segments import LONGEST_S, NODES, Segments

FEATURES = 27
# The first columns are the two rows of a segment's equations (`SetNetwork`): by how much its way is
# short of the assumed pace, by how much its second half is of its first, and the derivatives of
# either by leaning ahead and to the right.
SHORT, SHORTER, SLOPES, SLOPES_APART = 0, 1, slice(2, 4), slice(4, 6)
MIRRORED = (3, 5, 6, 10, 13, 15, 23)  # change sign where right and left are exchanged
_LOWEST = 0.02  # sine below the horizon: what would walk farther than 50 heights is held there
_LEAST_PACE = 0.02  # of the assumed speed
_STEEPEST = 30.0
_STRAIGHT = 22  # column
_STRAIGHT_ENOUGH = 0.85
_PACE_RATIO = np.log(5.0)


def segment_features(
    segments: Segments,
    intrinsics: Intrinsics,
    pose: CameraPose,
    prior: CameraPose,
    speed_mps: float,
) -> Array:
    """Features (B, 27) of segments of walks looked at from a pose.

    Places are in heights of the prior pose, where those of its reference are, too.
    """
    if not len(segments):
        return np.empty((0, FEATURES))
    rays, _ = intrinsics.rays(segments.nodes_uv)
    level = np.nan_to_num(rays) @ pose.level_from_camera.T
    level = level / np.maximum(np.linalg.norm(level, axis=-1, keepdims=True), 1e-9)
    ground = level[..., :2] / _safe(-level[..., 2:])  # (B, 5, 2) in heights of the pose
    scale = pose.height_m / prior.height_m
    expected = speed_mps * segments.duration_s / pose.height_m  # of the whole way, in heights
    moves = np.diff(ground, axis=1)
    paces = _log_pace(np.linalg.norm(moves, axis=-1), expected[:, None] / (NODES - 1))
    whole, slopes = _stretch(ground[:, 0], ground[:, -1])
    first, first_slopes = _stretch(ground[:, 0], ground[:, 2])
    second, second_slopes = _stretch(ground[:, 2], ground[:, -1])
    pace = _log_pace(whole, expected)
    slower = _log_pace(second, expected / 2) - _log_pace(first, expected / 2)
    apart = second_slopes - first_slopes
    way = ground[:, -1] - ground[:, 0]
    course = np.arctan2(way[:, 0], way[:, 1])
    halves = ground[:, 2] - ground[:, 0], ground[:, 4] - ground[:, 2]
    turn = (halves[0][:, 0] * halves[1][:, 1] - halves[0][:, 1] * halves[1][:, 0]) / (
        first * second + 1e-6
    )
    middle = level[:, 2]
    ends = level[:, -1] - level[:, 0]
    px = np.sqrt(intrinsics.fx * intrinsics.fy)
    columns = [
        -pace,
        -slower,
        *np.clip(slopes, -_STEEPEST, _STEEPEST).T,
        *np.clip(apart, -_STEEPEST, _STEEPEST).T,
        middle[:, 0],
        middle[:, 1],
        -middle[:, 2],
        np.log(_safe(-middle[:, 2])),
        ends[:, 0],
        ends[:, 1],
        -ends[:, 2],
        np.sin(course),
        np.cos(course),
        np.sin(2 * course),
        np.cos(2 * course),
        *paces.T,
        np.log(np.linalg.norm(ground[:, 2], axis=-1) * scale + 0.05),
        whole / (np.linalg.norm(moves, axis=-1).sum(1) + 1e-6),
        np.clip(turn, -1, 1),
        np.log(segments.duration_s / LONGEST_S),
        np.log(segments.residual_px / px + 1e-4),
        np.log(np.linalg.norm(ends, axis=-1) + 1e-3),
    ]
    return np.stack(columns, axis=-1)


def _log_pace(way: Array, expected: Array) -> Array:
    return np.clip(np.log(way / expected + _LEAST_PACE), -3, 3)


def _stretch(begin: Array, end: Array) -> tuple[Array, Array]:
    """Lengths (B,) of ways between ground points, and derivatives (B, 2) of their logs.

    Of a camera that leans by e ahead, a point (x, y) in heights is at (x, y) - e (x y, 1 + y^2),
    and likewise to the right: the ray turns, and meets the ground elsewhere.
    """
    way = end - begin
    length = np.linalg.norm(way, axis=-1)
    along = way / np.maximum(length, 1e-9)[:, None] ** 2
    slopes = [((_drawn(end, axis) - _drawn(begin, axis)) * along).sum(-1) for axis in (1, 0)]
    return length, np.stack(slopes, axis=-1)


def _drawn(ground: Array, axis: int) -> Array:
    """Derivative (B, 2) of ground points by leaning along an axis: 1 ahead, 0 to the right."""
    moved = -ground * ground[:, axis, None]
    moved[:, axis] -= 1
    return np.asarray(moved)


def _safe(below: Array) -> Array:
    """Sines below the horizon; under `_LOWEST` ever closer to half of it, so that order is kept."""
    floor = _LOWEST / 2
    held = floor + floor * np.exp(np.minimum((below - _LOWEST) / floor, 0.0))
    return np.where(below > _LOWEST, below, held)


def walking(features: Array) -> Mask:
    """Mask of segments (B,) of people who walk: none who stand, dawdle, run or stray.

    They go straight, and as fast as most of the brisker half, give or take.
    """
    straight = features[:, _STRAIGHT] > _STRAIGHT_ENOUGH
    if not straight.any():
        return straight
    pace = -features[:, SHORT]
    usual = pace[straight]
    brisk = np.median(usual[usual >= np.median(usual)])
    return np.asarray(straight & (np.abs(pace - brisk) < _PACE_RATIO))
