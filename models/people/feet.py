"""Feet that are not where somebody stands: cut off by the picture's border, or hidden."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from models.estimation.joint.measures import measure_statures
from models.estimation.joint.observations import STEP_S, Observations
from models.estimation.parameters import plane_parameters_of
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array, Mask
from models.people.usual import residuals
from models.trajectory import Trajectory

_BOTTOM_PX, _BOTTOM_SHARE = 2.0, 0.004  # a box that is cut ends here
_HALF_WIDTH_M = 0.3  # of a person: nearer to the side, half of the box is missing
_SIDES = 0.2  # of the picture's width, in which that is asked
_SHORTER_SELF = 0.12  # of the log of a stature, than most of the time
_SHORTER = 0.25  # than others at this place: a child, or somebody behind a wall all the way
_SIGMAS = 4.0


def at_border(
    trajectories: Sequence[Trajectory], intrinsics: Intrinsics, pose: CameraPose
) -> list[Mask]:
    """Which points (N,) of each track are so near to the border that a box is cut there.

    The foot of somebody who leaves the picture below stays at its lower edge while they walk on;
    that of somebody half out of it at a side goes half as fast.
    """
    if not trajectories:
        return []
    uv = np.concatenate([trajectory.uv for trajectory in trajectories])
    last_v = intrinsics.height - 1
    cut = uv[:, 1] >= last_v - max(_BOTTOM_PX, _BOTTOM_SHARE * intrinsics.height)
    margin = np.minimum(uv[:, 0], intrinsics.width - 1 - uv[:, 0])
    asked = np.flatnonzero((margin < _SIDES * intrinsics.width) & ~cut)
    rays, known = intrinsics.rays(uv[asked])
    falling = -(rays @ pose.rotation)[:, 2]  # a metre is fx / depth, the depth height / falling
    metre_px = np.where(known, intrinsics.fx * falling / pose.height_m, 0.0)
    cut[asked] = margin[asked] < _HALF_WIDTH_M * np.maximum(metre_px, 0.0)
    sizes = [trajectory.time_s.size for trajectory in trajectories]
    return np.split(cut, np.cumsum(sizes)[:-1])


def hidden(observations: Observations, pose: CameraPose) -> tuple[Mask, Mask]:
    """Which steps (M,) and which boxes (K,) are of people whose lower body is hidden.

    Behind a hedge or a car the box ends above the ground: its foot seems farther away, and its
    height does not fit. Held against what is usual at that place of the picture, and against the
    same person elsewhere.
    """
    tops, rows = observations.tops, observations.tops.rows
    short = np.zeros(len(rows), dtype=bool)
    statures = measure_statures(tops, plane_parameters_of(pose), pose.heading_rad)
    seen = statures.valid
    if not seen.any():
        return np.zeros(len(observations.steps.rows), dtype=bool), short
    owner_idx = rows.owner_idx[seen]
    none = np.zeros((int(seen.sum()), 0))
    off = residuals(tops.foot_rays[seen, :2], none, statures.value[seen], owner_idx)
    own = _usual_of(off, owner_idx, observations.tracks)[owner_idx]
    sd = 1.4826 * float(np.median(np.abs(off - own)))
    short[seen] = (off < own - max(_SHORTER_SELF, _SIGMAS * sd)) | (off < -_SHORTER)
    return _beside(observations, short), short


def _usual_of(off: Array, owner_idx: npt.NDArray[np.int64], tracks: int) -> Array:
    """The upper quartile (tracks,) of each track's: hidden is who is seen shorter, never taller."""
    order = np.lexsort((off, owner_idx))
    number = np.bincount(owner_idx, minlength=tracks)
    first = np.cumsum(number) - number
    at = first + (3 * np.maximum(number - 1, 0)) // 4
    return np.asarray(off[order][np.minimum(at, off.size - 1)])


def _beside(observations: Observations, short: Mask) -> Mask:
    """Which steps (M,) begin or end at a box that is too short."""
    steps, tops = observations.steps.rows, observations.tops.rows
    if not short.any() or not len(steps):
        return np.zeros(len(steps), dtype=bool)
    start_s = min(float(steps.time_s.min()), float(tops.time_s.min()))
    span_s = max(float(steps.time_s.max()), float(tops.time_s.max())) - start_s + 10 * STEP_S
    hidden_at = np.sort((tops.owner_idx * span_s + tops.time_s - start_s)[short])
    at = steps.owner_idx * span_s + steps.time_s - start_s
    right = np.minimum(np.searchsorted(hidden_at, at), hidden_at.size - 1)
    left = np.maximum(right - 1, 0)
    apart = np.minimum(np.abs(hidden_at[right] - at), np.abs(hidden_at[left] - at))
    return np.asarray(apart < 0.55 * STEP_S)
