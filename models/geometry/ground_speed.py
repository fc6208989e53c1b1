"""Walking speed over the ground, as a pose has it."""

import math
from collections.abc import Sequence

import numpy as np

from models.geometry.ground import ground_from_pixel
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array

_STRIDE_S = 2.0  # a box jitters from frame to frame; over two steps it hardly does


def walking_speed(
    intrinsics: Intrinsics, pose: CameraPose, tracks: Sequence[tuple[Array, Array]]
) -> float:
    """The speed in m/s at which half of all ground is covered; NaN where nobody covers any.

    By distance rather than by time, people who stand and wait do not count as slow walkers.

    Args:
        intrinsics: the lens.
        pose: of the camera.
        tracks: of each person increasing times (N,) and pixels of the foot (N, 2).
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
