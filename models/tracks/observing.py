"""Read steps of walkers and tops of their boxes out of tracks.

Nothing here depends on the pose. All tracks go through the loops together: one by one they would
take thirty times as long.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array, Mask
from models.tracks.loops.jumps import jumped
from models.tracks.loops.runs import nodes_of_runs, runs_of_tracks
from models.tracks.loops.short_boxes import short_boxes
from models.tracks.loops.ways import steps_of_runs
from models.tracks.observations import Observations, Rows, Steps, Tops
from models.tracks.trajectory import Trajectory, points_of, points_where


def observe(trajectories: Sequence[Trajectory], intrinsics: Intrinsics) -> Observations:
    """Steps and box tops of trajectories.

    Each run of feet inside the image without a gap is smoothed by a local straight line at nodes
    1.5 s apart, so that noise of the tracker does not read as speed; between nodes lie the steps.
    """
    points = points_of(trajectories)
    ended_s = points.time_s[points.bounds[1:] - 1]
    short = short_boxes(points.uv, points.top_v, points.bounds)
    high = jumped(points.time_s, points.uv, points.bounds, float(intrinsics.height))
    points = points_where(points, ~(short | high))
    inside = intrinsics.shows_foot(points.uv)
    runs = runs_of_tracks(points.time_s, inside, points.bounds)
    firsts, nodes_s, feet, tops = nodes_of_runs(points.time_s, points.uv, points.top_v, runs)
    rays, valid = intrinsics.rays(feet)
    run = np.repeat(np.arange(len(runs)), np.diff(firsts))
    owner_idx = runs[run, 0]
    # A run counts where all of its nodes have rays.
    whole = np.bincount(run, ~valid, len(runs))[run] == 0
    start, end, noisy_end = steps_of_runs(np.where(valid[:, None], rays, 0.0), firsts)
    last = np.diff(run, append=-1) != 0
    step = np.flatnonzero(whole & ~last)
    top_y = np.full(nodes_s.size, np.nan)
    boxed = np.flatnonzero(whole & np.isfinite(tops))
    top_rays, known = intrinsics.rays(np.stack([feet[boxed, 0], tops[boxed]], axis=-1))
    top_y[boxed[known]] = top_rays[known, 1]
    top = np.flatnonzero(np.isfinite(top_y))
    seconds = nodes_s[step + 1] - nodes_s[step]
    middle_s = (nodes_s[step] + nodes_s[step + 1]) / 2
    count = len(trajectories)
    return Observations(
        steps=Steps(
            start_rays=start[step],
            end_rays=end[step],
            noisy_end_rays=noisy_end[step],
            seconds=seconds,
            rows=_rows(owner_idx[step], run[step], middle_s, count),
        ),
        tops=Tops(
            foot_rays=rays[top],
            top_y=top_y[top],
            rows=_rows(owner_idx[top], run[top], nodes_s[top], count),
        ),
        ended_s=ended_s,
        tracks=count,
    )


def _rows(
    owner_idx: npt.NDArray[np.int64], run: npt.NDArray[np.int64], time_s: Array, count: int
) -> Rows:
    linked: Mask = np.zeros(owner_idx.size, dtype=bool)
    linked[1:] = run[1:] == run[:-1]
    number = np.maximum(np.bincount(owner_idx, minlength=count), 1)
    # Sums of epoch seconds lose digits: from the first row on.
    since_s = time_s - (time_s[0] if time_s.size else 0.0)
    middle_s = np.bincount(owner_idx, since_s, count) / number
    when = (since_s - middle_s[owner_idx]) / 10
    return Rows(owner_idx=owner_idx, linked=linked, time_s=time_s, when=when, owners=count)
