"""How fast feet move over the ground, as a pose has it."""

import math

import numpy as np

from models.geometry.ground import ground_from_pixel
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array

_STRIDE_S = 2.0  # a box jitters from frame to frame; over two steps it hardly does


def ground_speed(intrinsics: Intrinsics, pose: CameraPose, time_s: Array, uv: Array) -> float:
    """The median speed in m/s of one track over strides of 2 s; NaN where less of it is on ground.

    Args:
        intrinsics: the lens.
        pose: of the camera.
        time_s: increasing times (N,).
        uv: pixels of the foot (N, 2).
    """
    ground, hits = ground_from_pixel(intrinsics, pose.rotation, pose.centre_m, uv)
    ends = np.searchsorted(time_s, time_s + _STRIDE_S)
    starts = np.flatnonzero(ends < len(time_s))
    ends = ends[starts]
    known = hits[starts] & hits[ends]
    if not known.any():
        return math.nan
    starts, ends = starts[known], ends[known]
    steps = np.hypot(*(ground[ends] - ground[starts]).T)
    return float(np.median(steps / (time_s[ends] - time_s[starts])))
