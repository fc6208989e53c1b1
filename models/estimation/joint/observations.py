"""What the joint estimator reads of tracks: steps of walkers and the tops of their boxes.

Nothing here depends on the pose. Source of the smoothing: Cleveland 1979, local straight lines.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from models.doors.moments import Moments
from models.errors import ShapeError
from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array, Mask
from models.quantiles import SD_OF_MEDIAN_DEVIATION
from models.trajectory import Trajectory
from models.verticals.uprights import Uprights

STEP_S = 1.5  # longer than a stride, shorter than a change of mind
_KERNEL_S = 0.7  # half the width of the smoothing around a node
_LONGEST_GAP_S = 1.1
_FEWEST_POINTS = 3
_WAY_NODES = 2  # on both sides of a step: 4.5 s
_LARGEST_DIRECTION_NOISE = 0.5
_LEAST_CHORD = 1e-7  # of a ray: far less than a pixel


@dataclass(frozen=True, slots=True, kw_only=True)
class Rows:
    """Whose each of M rows is; the rows of a track stand together, in time order.

    `owner_idx` (M,) is the track, `linked` (M,) says that a row follows the one before it without
    a gap, `time_s` (M,) is when it was and `when` (M,) how long after the middle of its track's
    rows, in units of 10 s. `owners` is the number of tracks, with and without rows.
    """

    owner_idx: npt.NDArray[np.int64]
    linked: Mask
    time_s: Array
    when: Array
    owners: int

    def __len__(self) -> int:
        return int(self.owner_idx.size)


@dataclass(frozen=True, slots=True, kw_only=True)
class Steps:
    """Pieces of walks about 1.5 s long: rays to both ends (M, 3), z = 1, and seconds (M,).

    The ends lie along the longer chord around a step, in the image, as far apart as the step
    went along it: what noise adds sideways is not walked. Left in, its share in a speed would
    depend on the pose, and poses that hide noise would be taken for likely ones. `noisy_end_rays`
    (M, 3) are the far ends if the chord is turned by one standard deviation of its own noise.
    """

    start_rays: Array
    end_rays: Array
    noisy_end_rays: Array
    seconds: Array
    rows: Rows


@dataclass(frozen=True, slots=True, kw_only=True)
class Tops:
    """Boxes: rays of the feet (M, 3), z = 1, and the undistorted y (M,) of the upper edges."""

    foot_rays: Array
    top_y: Array
    rows: Rows


@dataclass(frozen=True, slots=True, kw_only=True)
class Observations:
    """All that is read of a set of tracks, and when each of them ended (tracks,).

    `uprights` are of heads, `moments` of doors; None where nobody looked for any.
    """

    steps: Steps
    tops: Tops
    ended_s: Array
    tracks: int
    uprights: Uprights | None = None
    moments: Moments | None = None

    @property
    def walkers(self) -> int:
        """How many tracks have at least one step."""
        return int(np.unique(self.steps.rows.owner_idx).size)


def observe(trajectories: Sequence[Trajectory], intrinsics: Intrinsics) -> Observations:
    """Steps and box tops of trajectories.

    Each run of points inside the image without a gap is smoothed by a local straight line at nodes
    1.5 s apart, so that noise of the tracker does not read as speed; between nodes lie the steps.
    """
    starts, ends, noisy_ends, seconds, feet, tops = [], [], [], [], [], []
    step_owners, top_owners, step_runs, top_runs = (list[int]() for _ in range(4))
    step_times, top_times = list[Array](), list[Array]()
    run, count = 0, len(trajectories)
    for owner, trajectory in enumerate(trajectories):
        for indices in _runs(trajectory, intrinsics):
            time_s, uv, top_v = _nodes(trajectory, indices)
            rays, valid = intrinsics.rays(uv)
            if time_s.size < 2 or not valid.all():
                continue
            run += 1
            start, end, noisy_end = _steps(rays)
            starts.append(start)
            ends.append(end)
            noisy_ends.append(noisy_end)
            seconds.append(np.diff(time_s))
            step_owners += [owner] * (time_s.size - 1)
            step_runs += [run] * (time_s.size - 1)
            step_times.append((time_s[:-1] + time_s[1:]) / 2)
            top_rays, known = intrinsics.rays(np.stack([uv[:, 0], top_v], axis=-1))
            feet.append(rays[known])
            tops.append(top_rays[known, 1])
            top_owners += [owner] * int(known.sum())
            top_runs += [run] * int(known.sum())
            top_times.append(time_s[known])
    return Observations(
        steps=Steps(
            start_rays=_joined(starts, (0, 3)),
            end_rays=_joined(ends, (0, 3)),
            noisy_end_rays=_joined(noisy_ends, (0, 3)),
            seconds=_joined(seconds, (0,)),
            rows=_rows(step_owners, step_runs, step_times, count),
        ),
        tops=Tops(
            foot_rays=_joined(feet, (0, 3)),
            top_y=_joined(tops, (0,)),
            rows=_rows(top_owners, top_runs, top_times, count),
        ),
        ended_s=np.array([trajectory.time_s[-1] for trajectory in trajectories], dtype=np.float64),
        tracks=count,
    )


def check_in_time(observations: Observations) -> None:
    """Refuse tracks that are not in the order of their ends: what came after what counts here.

    Raises:
        ShapeError: a track that ended before the one before it.
    """
    early = np.flatnonzero(np.diff(observations.ended_s) < 0)
    if early.size:
        track = int(early[0]) + 1
        before_s = float(observations.ended_s[track - 1] - observations.ended_s[track])
        raise ShapeError(
            f"tracks: must be in the order of their ends, got one at {track} that ended "
            f"{before_s:g} s before the one at {track - 1}"
        )


def of_tracks(observations: Observations, chosen: npt.NDArray[np.int64]) -> Observations:
    """The observations of some tracks only, given by ascending indices."""
    renumber = np.full(observations.tracks, -1)
    renumber[chosen] = np.arange(chosen.size)
    tops = observations.tops
    steps = steps_where(observations.steps, renumber[observations.steps.rows.owner_idx] >= 0)
    every = np.ones(len(steps.rows), dtype=bool)
    kept_tops = renumber[tops.rows.owner_idx] >= 0
    return Observations(
        steps=replace(steps, rows=_kept(steps.rows, every, renumber, chosen.size)),
        tops=Tops(
            foot_rays=tops.foot_rays[kept_tops],
            top_y=tops.top_y[kept_tops],
            rows=_kept(tops.rows, kept_tops, renumber, chosen.size),
        ),
        ended_s=observations.ended_s[chosen],
        tracks=int(chosen.size),
        uprights=None if observations.uprights is None else observations.uprights.of_tracks(chosen),
        moments=None if observations.moments is None else observations.moments.of_tracks(chosen),
    )


def steps_where(steps: Steps, kept: Mask) -> Steps:
    """Some of the steps; one whose step before it is not among them is linked to none."""
    rows = steps.rows
    linked = rows.linked.copy()
    linked[1:] &= kept[:-1]
    return Steps(
        start_rays=steps.start_rays[kept],
        end_rays=steps.end_rays[kept],
        noisy_end_rays=steps.noisy_end_rays[kept],
        seconds=steps.seconds[kept],
        rows=_kept(replace(rows, linked=linked), kept, np.arange(rows.owners), rows.owners),
    )


def _runs(trajectory: Trajectory, intrinsics: Intrinsics) -> list[npt.NDArray[np.int64]]:
    inside = intrinsics.contains(trajectory.uv)
    intervals = np.diff(trajectory.time_s)
    usual_s = float(np.median(intervals)) if intervals.size else 0.0
    gap = intervals > max(2.5 * usual_s, _LONGEST_GAP_S)
    breaks = np.flatnonzero(gap | ~inside[1:] | ~inside[:-1]) + 1
    runs = np.split(np.arange(inside.size), breaks)
    return [run for run in runs if run.size >= _FEWEST_POINTS and inside[run].all()]


def _nodes(trajectory: Trajectory, indices: npt.NDArray[np.int64]) -> tuple[Array, Array, Array]:
    """Times (K,), smoothed feet (K, 2) and box tops (K,), NaN where unknown, of one run."""
    time_s, uv = trajectory.time_s[indices], trajectory.uv[indices]
    duration_s = float(time_s[-1] - time_s[0])
    count = int(duration_s / STEP_S + 1e-6)
    if count < 1:
        return np.empty(0), np.empty((0, 2)), np.empty(0)
    nodes_s = time_s[0] + (duration_s - count * STEP_S) / 2 + np.arange(count + 1) * STEP_S
    reach_s = max(_KERNEL_S, 1.01 * float(np.median(np.diff(time_s))))
    ahead = time_s - nodes_s[:, None]  # (K, N)
    weight = np.clip(1 - np.abs(ahead) / reach_s, 0, None)
    feet = np.stack([np.interp(nodes_s, time_s, uv[:, axis]) for axis in (0, 1)], axis=-1)
    lined, smooth = _local_lines(ahead, weight, uv)
    feet[lined] = smooth[lined]
    tops = np.full(nodes_s.size, np.nan)
    if trajectory.top_v is not None:
        # The box's height is smoothed, not its top: it is the same all through a stride.
        tall = uv[:, 1] - trajectory.top_v[indices]
        known = np.isfinite(tall)
        if known.sum() >= 2:
            enough, smooth = _local_lines(ahead[:, known], weight[:, known], tall[known, None])
            tops[enough] = feet[enough, 1] - smooth[enough, 0]
    return nodes_s, feet, tops


def _steps(rays: Array) -> tuple[Array, Array, Array]:
    """Rays (K - 1, 3) to both ends of the steps between nodes (K, 3), and to the noisy far ends."""
    way, lever = _ways(rays)
    along = np.abs(((rays[1:] - rays[:-1]) * way).sum(axis=1))
    middle = (rays[1:] + rays[:-1]) / 2
    half = np.maximum(along, _LEAST_CHORD)[:, None] / 2
    aside = np.stack([-way[:, 1], way[:, 0], np.zeros(len(way))], axis=1)
    noise = np.minimum(_noise(rays, aside) / lever, _LARGEST_DIRECTION_NOISE)[:, None]
    return middle - half * way, middle + half * way, middle + half * (way + noise * aside)


def _ways(rays: Array) -> tuple[Array, Array]:
    """Directions (K - 1, 3) of the steps: of straight lines through the nodes around each.

    A node's noise over the lever (K - 1,) is the direction's, in radians.
    """
    count = len(rays)
    ahead = np.arange(count) - np.arange(count - 1)[:, None] - 0.5  # (K - 1, K)
    weight = (np.abs(ahead) < _WAY_NODES).astype(np.float64)
    ahead = ahead - (weight * ahead).sum(axis=1, keepdims=True) / weight.sum(axis=1, keepdims=True)
    moment = (weight * ahead**2).sum(axis=1)
    slope = (weight * ahead) @ rays / moment[:, None]
    length = np.maximum(np.linalg.norm(slope, axis=1), _LEAST_CHORD)
    return slope / length[:, None], length * np.sqrt(moment)


def _noise(rays: Array, aside: Array) -> float:
    """Standard deviation of a node of a run, sideways, by differences (Gasser et al. 1986)."""
    if len(rays) < 3:
        return 0.0  # two nodes make one step, and one step has no track to differ from
    bend = ((rays[2:] - 2 * rays[1:-1] + rays[:-2]) * aside[1:]).sum(axis=1)
    return float(SD_OF_MEDIAN_DEVIATION * np.median(np.abs(bend)) / np.sqrt(6))


def _local_lines(ahead: Array, weight: Array, values: Array) -> tuple[Mask, Array]:
    """Where there are two points to go by (K,), and weighted straight lines' values (K, D)."""
    enough = (weight > 0).sum(axis=1) >= 2
    total = np.maximum(weight.sum(axis=1), 1e-12)
    centre = (weight * ahead).sum(axis=1) / total
    spread = ((weight * (ahead - centre[:, None]) ** 2).sum(axis=1)) / total
    mean = weight @ values / total[:, None]
    slope = (weight * (ahead - centre[:, None])) @ values / total[:, None]
    slope = slope / np.maximum(spread, 1e-9)[:, None]
    return enough, mean - slope * centre[:, None]


def _rows(owners: list[int], runs: list[int], times: list[Array], count: int) -> Rows:
    owner_idx, run = np.array(owners, dtype=np.int64), np.array(runs, dtype=np.int64)
    linked = np.zeros(owner_idx.size, dtype=bool)
    linked[1:] = run[1:] == run[:-1]
    time_s = _joined(times, (0,))
    number = np.maximum(np.bincount(owner_idx, minlength=count), 1)
    # Sums of epoch seconds lose digits: from the first row on.
    since_s = time_s - (time_s[0] if time_s.size else 0.0)
    middle_s = np.bincount(owner_idx, since_s, count) / number
    when = (since_s - middle_s[owner_idx]) / 10
    return Rows(owner_idx=owner_idx, linked=linked, time_s=time_s, when=when, owners=count)


def _kept(rows: Rows, kept: Mask, renumber: npt.NDArray[np.int64], owners: int) -> Rows:
    return Rows(
        owner_idx=renumber[rows.owner_idx[kept]],
        linked=rows.linked[kept],
        time_s=rows.time_s[kept],
        when=rows.when[kept],
        owners=owners,
    )


def _joined(pieces: list[Array], empty: tuple[int, ...]) -> Array:
    return np.concatenate(pieces) if pieces else np.empty(empty)
