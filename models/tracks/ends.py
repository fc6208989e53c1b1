"""The ends of tracks on the ground: places with their covariance, and velocities."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from models.compiled import compiled
from models.geometry.ground import ground_from_pixel
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array, Mask
from models.geometry.upright import statures
from models.tracks import config
from models.tracks.trajectory import Points, Trajectory, points_of


@dataclass(frozen=True, slots=True, kw_only=True)
class Ends:
    """One end of each of N tracks, on the ground at a pose.

    `time_s` (N,) is when, `place` (N, 2) where in metres, with covariance `noise` (N, 2, 2);
    `velocity` (N, 2) in m/s is of `span_s` (N,) around it. `log_tall` (N,) is the log of the
    stature in metres by boxes, NaN where these are not known. What is not `valid` (N,), too few
    points or no ground there, is 0.
    """

    time_s: Array
    place: Array
    velocity: Array
    noise: Array
    span_s: Array
    log_tall: Array
    valid: Mask


def ends_of(
    trajectories: Sequence[Trajectory], intrinsics: Intrinsics, pose: CameraPose
) -> tuple[Ends, Ends]:
    """The first and the last ends of tracks, one at least, as a camera at a pose places them."""
    points = points_of(trajectories)
    heads, tails = (_ends(points, last, intrinsics, pose) for last in (False, True))
    return heads, tails


def _ends(points: Points, last: bool, intrinsics: Intrinsics, pose: CameraPose) -> Ends:
    chosen, owner = points_at_ends(points.time_s, points.bounds, last)
    at = points.bounds[1:] - 1 if last else points.bounds[:-1]
    count, end_s, uv = at.size, points.time_s[at], points.uv[chosen]
    since_s = points.time_s[chosen] - end_s[owner]
    ground, seen = ground_from_pixel(intrinsics, pose.rotation, pose.centre_m, uv)
    ground = np.where(seen[:, None], ground, 0.0)
    number = np.bincount(owner, seen, count)
    enough = np.maximum(number, 1)
    middle_s = np.bincount(owner, seen * since_s, count) / enough
    apart_s = np.where(seen, since_s - middle_s[owner], 0.0)
    moment = np.bincount(owner, apart_s**2, count)
    middle = _sums(owner, ground, count) / enough[:, None]
    velocity = _sums(owner, apart_s[:, None] * ground, count) / np.maximum(moment, 1e-9)[:, None]
    noise, on_ground = _noise(points.uv[at], intrinsics, pose)
    valid = (number >= 2) & (number == np.bincount(owner, minlength=count)) & on_ground
    return Ends(
        time_s=end_s,
        place=np.where(valid[:, None], middle - velocity * middle_s[:, None], 0.0),
        velocity=np.where(valid[:, None], velocity, 0.0),
        noise=np.where(valid[:, None, None], noise, 0.0),
        span_s=np.sqrt(12 * moment / enough),  # of evenly spread times
        log_tall=_log_tall(uv, points.top_v[chosen], owner, count, intrinsics, pose),
        valid=valid,
    )


def _noise(uv: Array, intrinsics: Intrinsics, pose: CameraPose) -> tuple[Array, Mask]:
    """Covariances (N, 2, 2) of the places of feet in pixels (N, 2), and which are on ground."""
    beside = uv.reshape(-1, 1, 2) + np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    ground, seen = ground_from_pixel(intrinsics, pose.rotation, pose.centre_m, beside)
    by_pixel = np.stack([ground[:, 1] - ground[:, 0], ground[:, 2] - ground[:, 0]], axis=2)
    # A metre across the line of sight is as many pixels as the least that one moves a place.
    metres = np.maximum(np.linalg.svd(np.nan_to_num(by_pixel), compute_uv=False)[:, 1], 1e-9)
    sd_px = np.hypot(config.FOOT_NOISE_PX, config.FOOT_NOISE_M / metres)
    covariance = by_pixel @ np.swapaxes(by_pixel, 1, 2) * sd_px[:, None, None] ** 2
    return covariance, np.asarray(seen.all(axis=1))


def _log_tall(
    uv: Array,
    top_v: Array,
    owner: npt.NDArray[np.int64],
    count: int,
    intrinsics: Intrinsics,
    pose: CameraPose,
) -> Array:
    """Logs of statures (N,) by the points of N ends, NaN where there are no boxes."""
    tall = np.full(count, np.nan)
    boxed = np.flatnonzero(np.isfinite(top_v))
    if not boxed.size:
        return tall
    tall_m, known = statures(intrinsics, pose.rotation, pose.height_m, uv[boxed], top_v[boxed])
    number = np.bincount(owner[boxed], known, count)
    logs = np.where(known, np.log(np.where(known, tall_m, 1.0)), 0.0)
    total = np.bincount(owner[boxed], logs, count)
    return np.where(number > 0, total / np.maximum(number, 1), np.nan)


def _sums(owner: npt.NDArray[np.int64], values: Array, count: int) -> Array:
    columns = [np.bincount(owner, values[:, axis], count) for axis in range(values.shape[1])]
    return np.stack(columns, axis=1)


@compiled
def points_at_ends(
    time_s: Array, bounds: npt.NDArray[np.int64], last: bool
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Some points (K,) within a time of an end of each track, in time order, and the tracks (K,).

    The end's own point is among them.
    """
    chosen = np.empty(config.END_POINTS * (bounds.size - 1), dtype=np.int64)
    owner = np.empty(chosen.size, dtype=np.int64)
    found = 0
    for track in range(bounds.size - 1):
        first, final = bounds[track], bounds[track + 1] - 1
        usual_s = (time_s[final] - time_s[first]) / max(final - first, 1)
        reach_s = max(config.END_SPAN_S, config.END_USUAL_GAPS * usual_s)
        low, high = first, final
        if last:
            low = final
            while low > first and time_s[low - 1] >= time_s[final] - reach_s:
                low -= 1
        else:
            high = first
            while high < final and time_s[high + 1] <= time_s[first] + reach_s:
                high += 1
        stride = -(-(high - low + 1) // config.END_POINTS)
        number = (high - low) // stride + 1
        begin = high - (number - 1) * stride if last else low
        for place in range(number):
            chosen[found], owner[found] = begin + place * stride, track
            found += 1
    return chosen[:found], owner[:found]
