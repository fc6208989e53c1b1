"""The image size that the numbers of tracks belong to, where it is not the camera's frame size.

Detectors often run on a smaller stream and post its pixels, or shares of the image. Both are
recognised only if the numbers fit within another usual image and people walk more plausibly there:
people who walk in a corner of the frame raise no doubt.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.geometry.ground import ground_from_pixel
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array, Mask
from models.geometry.upright import statures
from models.reasons import Reason, TracksCode, Value
from models.tracks import config
from models.tracks.scaling import SAME, Scaling, scaling_of_size
from models.tracks.trajectory import Trajectory

Size = tuple[int, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Walking:
    """How people walk if the numbers are taken as an image of one size.

    `on_ground` is the share of the foot points inside the frame and on the ground. Speeds and
    statures are medians over tracks, spreads are standard deviations of logs: `speed_spread` and
    `stature_spread` between tracks, `pace_spread` within a track. NaN where too few tracks are
    known.
    """

    tracks: int
    on_ground: float
    speed_mps: float
    speed_spread: float
    pace_spread: float
    stature_m: float
    stature_spread: float

    @property
    def walking_score(self) -> float:
        """Log likelihood of the speeds, and of feet outside the ground, up to a constant."""
        people = min(self.tracks, config.SIZE_MOST_TRACKS)
        level, pace, spread = np.inf, config.SIZE_UNKNOWN_PACE, 1.0
        if np.isfinite(self.speed_mps):
            level = np.log(self.speed_mps / config.SIZE_SPEED_MPS) / config.SIZE_SPEED_SD
            pace, spread = max(self.pace_spread, 0.05), max(self.speed_spread, 0.1)
        even = config.SIZE_PACE_WEIGHT * np.log(pace) + config.SIZE_SPREAD_WEIGHT * np.log(spread)
        outside = config.SIZE_OUTSIDE * (1 - self.on_ground)
        return float(-min(level**2 / 2, config.SIZE_MOST_LEVEL) - people * even - outside)

    @property
    def stature_score(self) -> float:
        """Log likelihood of the statures, up to a constant; 0 where boxes are unknown."""
        if not np.isfinite(self.stature_m):
            return 0.0
        level = np.log(self.stature_m / config.SIZE_STATURE_M) / config.SIZE_STATURE_SD
        spread = np.log(max(self.stature_spread, 0.05))
        return float(-min(level**2 / 2, config.SIZE_MOST_LEVEL) - config.SIZE_STATURES * spread)


def doubt_image_size(
    trajectories: Sequence[Trajectory], intrinsics: Intrinsics, prior: CameraPose | None
) -> Reason | None:
    """A reason to doubt that tracks are in pixels of the camera's frame; None if there is none.

    `prior` is the pose at which walking is judged; without one only shares are recognised.
    """
    if len(trajectories) < config.SHARES_FEWEST:
        return None
    uv = np.concatenate([trajectory.uv for trajectory in trajectories])
    low, high = config.SHARES_PX
    if uv.min() >= low and uv.max() <= high:
        values: dict[str, Value] = {"tracks": len(trajectories), "largest_px": float(uv.max())}
        return Reason(code=TracksCode.IMAGE_SHARES, values=values)
    if prior is None or len(trajectories) < config.SIZE_FEWEST:
        return None
    return _other_size(trajectories, uv, intrinsics, prior)


def _other_size(
    trajectories: Sequence[Trajectory], uv: Array, intrinsics: Intrinsics, prior: CameraPose
) -> Reason | None:
    frame = (intrinsics.width, intrinsics.height)
    sizes = fitting_sizes(uv, frame)
    if not sizes:
        return None
    now = _walking(trajectories, SAME, intrinsics, prior)
    reach = np.quantile(uv, config.SIZE_REACH_QUANTILE, axis=0)
    likely = []
    for size in sizes:
        then = _walking(trajectories, scaling_of_size(size, frame), intrinsics, prior)
        gain = _gain(now, then) - config.SIZE_OTHER_SHAPE * (not _same_shape(size, frame))
        if gain >= config.SIZE_LEAST_GAIN:
            closeness = np.log(min((reach / size).max(), 1.0))
            likely.append((gain + config.SIZE_CLOSENESS * closeness, size, then))
    likely.sort(key=lambda each: -each[0])
    if not likely:
        return None
    return _reason(len(trajectories), [each[1] for each in likely], now, likely[0][2])


def _reason(tracks: int, sizes: Sequence[Size], now: _Walking, found: _Walking) -> Reason:
    values: dict[str, Value] = {
        "tracks": tracks,
        "width_px": sizes[0][0],
        "height_px": sizes[0][1],
        "sizes_px": [f"{width}x{height}" for width, height in sizes[: config.SIZE_MOST_NAMED]],
        "rescaled_speed_mps": found.speed_mps,
    }
    known = {"speed_mps": now.speed_mps}
    if np.isfinite(found.stature_m):
        known |= {"stature_m": now.stature_m, "rescaled_stature_m": found.stature_m}
    values |= {name: value for name, value in known.items() if np.isfinite(value)}
    return Reason(code=TracksCode.OTHER_IMAGE_SIZE, values=values)


def _gain(now: _Walking, then: _Walking) -> float:
    """Log odds of one image size against another; -inf if people walk too slowly or fast."""
    slow, fast = config.SIZE_SPEEDS_MPS
    if not slow <= then.speed_mps <= fast:
        return -np.inf
    walking = then.walking_score - now.walking_score
    stature = then.stature_score - now.stature_score
    return float(walking + np.clip(stature, -config.SIZE_MOST_STATURE, 0.0))


def fitting_sizes(uv: Array, frame: Size) -> list[Size]:
    """The usual image sizes (width, height) other than the frame that points (N, 2) fill.

    Nearly all points lie within such an image, and people reach its right or its lower edge. Feet
    may lie below it, where boxes are completed.
    """
    reach = np.quantile(uv, config.SIZE_REACH_QUANTILE, axis=0)
    lowest = uv[:, 1].max()
    found = []
    for size in _usual_sizes(frame):
        edge = np.array(size, dtype=float)
        within = (uv >= -config.SIZE_MARGIN * edge) & (uv <= (1 + config.SIZE_MARGIN) * edge)
        inside = (within.mean(axis=0) >= config.SIZE_WITHIN).all()
        filled = reach / edge
        reached = filled.max() >= config.SIZE_REACHED and filled.min() >= config.SIZE_FILLED
        if inside and reached and lowest <= config.SIZE_LOWEST * size[1]:
            found.append(size)
    return found


def _usual_sizes(frame: Size) -> list[Size]:
    parts = [(round(frame[0] / part), round(frame[1] / part)) for part in config.SIZE_PARTS]
    every = dict.fromkeys([*config.USUAL_SIZES, *parts])
    return [size for size in every if size != frame]


def _same_shape(one: Size, other: Size) -> bool:
    return abs(one[0] * other[1] / (one[1] * other[0]) - 1) < config.SIZE_SAME_SHAPE


def _walking(
    trajectories: Sequence[Trajectory], scaling: Scaling, intrinsics: Intrinsics, prior: CameraPose
) -> _Walking:
    on_ground, walks, paces, tall = [], [], [], []
    for trajectory in map(scaling.of_trajectory, trajectories):
        ground, hits = ground_from_pixel(intrinsics, prior.rotation, prior.centre_m, trajectory.uv)
        on_ground.append(float((hits & intrinsics.contains(trajectory.uv)).mean()))
        moved = _speeds(trajectory.time_s, ground, hits)
        if moved.sum() > 0 and moved.size > 1:
            speed = float((moved**2).sum() / moved.sum())  # by distance: pauses count little
            walked = np.log(moved[moved > config.SIZE_PAUSE * speed] / speed)
            walks.append((np.log(speed), moved.sum()))
            if walked.size > 3:
                paces.append(float(np.sqrt((walked**2).mean())))
        if trajectory.top_v is not None:
            metres, known = statures(
                intrinsics, prior.rotation, prior.height_m, trajectory.uv, trajectory.top_v
            )
            if known.sum() > 2:
                tall.append(np.log(np.median(metres[known])))
    speeds, weights = np.array(walks).reshape(-1, 2).T
    enough = speeds.size >= config.SIZE_FEWEST_SPEEDS and len(paces) > 0
    level = _weighted_median(speeds, weights) if enough else np.nan
    return _Walking(
        tracks=len(trajectories),
        on_ground=float(np.mean(on_ground)),
        speed_mps=float(np.exp(level)),
        speed_spread=_spread(speeds[speeds > level + np.log(config.SIZE_PAUSE)]),
        pace_spread=float(np.median(paces)) if paces else np.nan,
        stature_m=float(np.exp(np.median(tall))) if tall else np.nan,
        stature_spread=_spread(tall),
    )


def _speeds(time_s: Array, ground: Array, hits: Mask) -> Array:
    """Speeds (M,) in m/s over about a stride and a half, from each point that is on the ground."""
    ends = np.searchsorted(time_s, time_s + config.SIZE_STRIDE_S)
    starts = np.flatnonzero(ends < time_s.size)
    starts = starts[hits[starts] & hits[ends[starts]]]
    ends = ends[starts]
    metres = np.hypot(*(ground[ends] - ground[starts]).T)
    return np.asarray(metres / (time_s[ends] - time_s[starts]))


def _weighted_median(values: Array, weights: Array) -> float:
    order = np.argsort(values)
    covered = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(covered, covered[-1] / 2)])


def _spread(logs: Sequence[float] | Array) -> float:
    """A standard deviation, from the median absolute deviation; NaN of fewer than 4 values."""
    if len(logs) < 4:
        return np.nan
    values = np.asarray(logs)
    return float(1.4826 * np.median(np.abs(values - np.median(values))))
