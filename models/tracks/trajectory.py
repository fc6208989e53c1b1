"""Trajectories of pedestrians and the windows that a regressor reads of them."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from models.errors import ShapeError
from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array, Index, Mask
from models.rows import rows_of
from models.tracks import config

WINDOW_MIN_POINTS = 11
WINDOW_MAX_POINTS = 31  # N in [11, 31]: Xu et al. 2020, section 4.1
DEFAULT_STEP_S = 0.4
TRACK_MIN_POINTS = 5  # what is shorter tells nothing and is not taken
TRACK_MIN_DURATION_S = 2.0
_LONGEST_GAP_STEPS = 2.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Trajectory:
    """Foot points of one pedestrian in time order.

    `time_s` is (N,), strictly increasing, seconds since the Unix epoch; `uv` is (N, 2) in pixels.
    `top_v` (N,) is the upper edge of the person's box in pixels, NaN where none is known; None
    where there are no boxes at all. `head_uv` (N, 2) are heads in pixels, seen apart from the feet;
    NaN where none is known, None where there are none at all.

    Raises:
        ShapeError: the arrays do not fit, a number is not finite, or time does not increase.
    """

    time_s: Array
    uv: Array
    top_v: Array | None = None
    head_uv: Array | None = None

    def __post_init__(self) -> None:
        if self.time_s.ndim != 1 or self.uv.shape != (self.time_s.size, 2):
            raise ShapeError(
                f"uv: ({self.time_s.size}, 2) is needed beside time_s, got {self.uv.shape}"
            )
        if self.top_v is not None and self.top_v.shape != self.time_s.shape:
            raise ShapeError(
                f"top_v: ({self.time_s.size},) is needed beside time_s, got {self.top_v.shape}"
            )
        if self.head_uv is not None and self.head_uv.shape != self.uv.shape:
            raise ShapeError(
                f"head_uv: {self.uv.shape} is needed beside uv, got {self.head_uv.shape}"
            )
        if not self.time_s.size:
            raise ShapeError("time_s: at least 1 point is needed, got 0")
        # What increases from a finite number to another one is finite.
        increases = bool((self.time_s[1:] > self.time_s[:-1]).all())
        ends = math.isfinite(self.time_s[0]) and math.isfinite(self.time_s[-1])
        if not (ends and np.isfinite(self.uv).all()):
            raise ShapeError("time_s, uv: must be finite")
        if not increases:
            if not np.isfinite(self.time_s).all():
                raise ShapeError("time_s, uv: must be finite")
            raise ShapeError("time_s: must increase strictly")

    @property
    def long_enough(self) -> bool:
        """True if it is taken at all: at least 5 points over at least 2 s."""
        enough_s = TRACK_MIN_DURATION_S - 1e-6
        return self.time_s.size >= TRACK_MIN_POINTS and self.duration_s >= enough_s

    def part(self, indices: Index) -> "Trajectory":
        """The points of some indices, in time order."""
        return rows_of(self, indices)

    @property
    def duration_s(self) -> float:
        """Seconds from the first point to the last."""
        return float(self.time_s[-1] - self.time_s[0])


@dataclass(frozen=True, slots=True, kw_only=True)
class Windows:
    """Equally spaced pieces of trajectories: what the regressor reads.

    `uv` is (B, T, 2) in pixels, NaN after the first `lengths` (B,) points of each; `owner_idx`
    (B,) tells which of the given trajectories a window is from.
    """

    uv: Array
    lengths: Index
    owner_idx: Index

    def __len__(self) -> int:
        return int(self.lengths.size)


@dataclass(frozen=True, slots=True, kw_only=True)
class Points:
    """All points of N trajectories, one after the other.

    `time_s` (T,), `uv` (T, 2) and `top_v` (T,), NaN where no box is known, are as of a trajectory;
    that of number n begins at `bounds[n]` and ends before `bounds[n + 1]` (N + 1,).
    """

    time_s: Array
    uv: Array
    top_v: Array
    bounds: Index


def points_of(trajectories: Sequence[Trajectory]) -> Points:
    """The points of trajectories as arrays that loops over all of them take."""
    sizes = [trajectory.time_s.size for trajectory in trajectories]
    bounds = np.zeros(len(sizes) + 1, dtype=np.int64)
    np.cumsum(sizes, out=bounds[1:])
    top_v = np.full(int(bounds[-1]), np.nan)
    for trajectory, first in zip(trajectories, bounds.tolist(), strict=False):
        if trajectory.top_v is not None:
            top_v[first : first + trajectory.top_v.size] = trajectory.top_v
    uv = np.concatenate([np.empty((0, 2)), *(trajectory.uv for trajectory in trajectories)])
    return Points(
        time_s=np.concatenate([np.empty(0), *(trajectory.time_s for trajectory in trajectories)]),
        uv=np.ascontiguousarray(uv),  # of columns in memory it would be columns, too
        top_v=top_v,
        bounds=bounds,
    )


def points_where(points: Points, kept: Mask) -> Points:
    """Some of the points (T,) only; trajectories keep their numbers, with no point if need be."""
    before = np.concatenate([[0], np.cumsum(kept)])
    return rows_of(points, kept, bounds=before[points.bounds])


def most_nodes(points: int, duration_s: float) -> int:
    """The most nodes that so many points over so long a time can have, of which rows are made."""
    nodes_s = min(duration_s, (points - 1) * config.SPARSEST_GAP_S)
    return min(int(nodes_s / config.STEP_S) + 1, config.MOST_NODES)


def by_end(trajectories: Iterable[Trajectory]) -> list[Trajectory]:
    """Trajectories in the order of their ends, in which estimators take them."""
    return sorted(trajectories, key=end_key)


def end_key(trajectory: Trajectory) -> tuple[float, ...]:
    """Sort key of the order of ends. Of equal ends too, so that the same tracks have one order."""
    time_s = trajectory.time_s
    return (float(time_s[-1]), float(time_s[0]), *trajectory.uv[0].tolist())


def end_to_end(pieces: Sequence[Trajectory]) -> Trajectory:
    """One trajectory of pieces in time order; boxes, heads are unknown where a piece has none."""
    top_v, head_uv = None, None
    if any(piece.top_v is not None for piece in pieces):
        top_v = np.concatenate(
            [np.full(p.time_s.size, np.nan) if p.top_v is None else p.top_v for p in pieces]
        )
    if any(piece.head_uv is not None for piece in pieces):
        head_uv = np.concatenate(
            [np.full(p.uv.shape, np.nan) if p.head_uv is None else p.head_uv for p in pieces]
        )
    return Trajectory(
        time_s=np.concatenate([piece.time_s for piece in pieces]),
        uv=np.concatenate([piece.uv for piece in pieces]),
        top_v=top_v,
        head_uv=head_uv,
    )


def choose_step_s(trajectories: Sequence[Trajectory]) -> float:
    """The sampling step in seconds that a camera's tracks can offer; 0.4 s where nothing is known.

    A whole multiple of the median interval between points, near 0.4 s. It is made shorter, down to
    one interval, until four of five tracks give the eleven points that a window needs. Tracks
    sparser than 0.4 s give their own interval.
    """
    intervals = [np.diff(t.time_s) for t in trajectories if t.time_s.size > 1]
    if not intervals:
        return DEFAULT_STEP_S
    interval_s = float(np.median(np.concatenate(intervals)))
    short_s = float(np.quantile([t.duration_s for t in trajectories], 0.2))
    wanted_s = min(DEFAULT_STEP_S, short_s / (WINDOW_MIN_POINTS - 1))
    multiple = max(1, math.floor(wanted_s / interval_s + 0.05))
    # To whole milliseconds, never up: a step a hair too long loses the last point of every track.
    return math.floor(multiple * interval_s * 1000 + 1e-6) / 1000


def cut_windows(
    trajectories: Sequence[Trajectory],
    intrinsics: Intrinsics,
    step_s: float,
    max_points: int = WINDOW_MAX_POINTS,
) -> Windows:
    """Windows of 11 to 31 points (or to `max_points`) at a fixed step, from each trajectory.

    The rule: a trajectory is broken where its points leave the image or are more than 2.5 steps
    apart; each run is resampled linearly at `step_s` from its first point on; a run of n >= 11
    samples is cut into ceil(n / max_points) windows of equal length that do not overlap. What is
    shorter gives no window.
    """
    pieces: list[Array] = []
    owners: list[int] = []
    for owner, trajectory in enumerate(trajectories):
        for run in _runs(trajectory, intrinsics, step_s):
            count = math.ceil(len(run) / max_points)
            pieces += np.array_split(run, count)
            owners += [owner] * count
    uv = np.full((len(pieces), max_points, 2), np.nan)
    for row, piece in zip(uv, pieces, strict=True):
        row[: len(piece)] = piece
    return Windows(
        uv=uv,
        lengths=np.array([len(piece) for piece in pieces], dtype=np.int64),
        owner_idx=np.array(owners, dtype=np.int64),
    )


def _runs(trajectory: Trajectory, intrinsics: Intrinsics, step_s: float) -> list[Array]:
    """Resampled runs (n, 2), n >= 11, of a trajectory."""
    inside = intrinsics.contains(trajectory.uv)
    gap = np.diff(trajectory.time_s) > _LONGEST_GAP_STEPS * step_s
    breaks = np.flatnonzero(gap | ~inside[1:] | ~inside[:-1]) + 1
    runs = []
    for indices in np.split(np.arange(inside.size), breaks):
        if not inside[indices].all():
            continue
        time_s = trajectory.time_s[indices] - trajectory.time_s[indices[0]]
        # The small slack keeps the last point where rounding puts it a hair before the sample.
        samples_s = np.arange(math.floor(time_s[-1] / step_s + 1e-3) + 1) * step_s
        if samples_s.size >= WINDOW_MIN_POINTS:
            uv = trajectory.uv[indices]
            runs.append(np.stack([np.interp(samples_s, time_s, uv[:, axis]) for axis in (0, 1)], 1))
    return runs
