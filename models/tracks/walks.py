"""Observations of tracks, each walk once: the pieces of one are put together first.

What is observed does not depend on the pose. All tracks go through the loops together: one by one
they would take thirty times as long.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array, Index, Mask
from models.geometry.upright import uncut
from models.reasons import Reason, TracksCode
from models.tracks import config
from models.tracks.hidden_feet import jumped, short_boxes
from models.tracks.linking import link_pieces, walks_of
from models.tracks.observations import HeadFootPairs, Observations, Rows, Steps, Tops
from models.tracks.steps import nodes_of_runs, runs_of_tracks, steps_of_runs
from models.tracks.trajectory import Trajectory, end_to_end, points_of, points_where


@dataclass(frozen=True, slots=True, kw_only=True)
class Walks:
    """Observations of N tracks, by the order that they were given in.

    `walk_idx` (N,) is the track that each counts with, the last piece of its walk: the steps, boxes
    and heads of a walk in several pieces are that one's, and the others have none.
    """

    observations: Observations
    walk_idx: Index

    @property
    def pieces(self) -> int:
        """The number of tracks that are another's walk: they do not count by themselves."""
        return int((self.walk_idx != np.arange(self.walk_idx.size)).sum())

    @property
    def reason(self) -> Reason | None:
        """A reason that names a tracker which cuts walks; None where it cuts few or none."""
        tracks = self.walk_idx.size
        if not tracks or self.pieces < config.MANY_PIECES * tracks:
            return None
        values = {"tracks": float(tracks), "pieces": float(self.pieces)}
        return Reason(code=TracksCode.PIECES, values=values)


def observe_walks(
    trajectories: Sequence[Trajectory],
    intrinsics: Intrinsics,
    pose: CameraPose,
    before: Index | None = None,
) -> Walks:
    """Observe tracks, each walk once.

    The same tracks give the same, in whatever portions they came.

    They are in the order of their ends, of a camera at about its prior pose; `before` is what
    `link_pieces` says of them, where that is known by now.
    """
    if before is None:
        before = link_pieces(trajectories, intrinsics, pose)
    walk_idx = _last_pieces(trajectories, before)
    walks = _walks(trajectories, walk_idx)
    observations = replace(
        observe_each(walks, intrinsics),
        ended_s=np.array([trajectory.time_s[-1] for trajectory in trajectories], dtype=np.float64),
        heads=observe_heads(walks, intrinsics),
    )
    return Walks(observations=observations, walk_idx=walk_idx)


def observe(
    trajectories: Sequence[Trajectory], intrinsics: Intrinsics, pose: CameraPose
) -> Observations:
    """The steps, boxes and heads of tracks, each walk once: the observations of `observe_walks`."""
    return observe_walks(trajectories, intrinsics, pose).observations


def _last_pieces(trajectories: Sequence[Trajectory], before: Index) -> Index:
    """The last piece (N,) of each track's walk, by the piece before each."""
    first = walks_of(before)
    order = np.argsort([trajectory.time_s[0] for trajectory in trajectories], kind="stable")
    last = np.empty(before.size, dtype=np.int64)
    last[first[order]] = order  # of several the latest stays
    return last[first]


def _walks(pieces: Sequence[Trajectory], walk_idx: Index) -> list[Trajectory]:
    """Whole walks in the places of their last pieces; a point, no walk, in those of the others."""
    walks = list(pieces)
    for last in np.unique(walk_idx[walk_idx != np.arange(walk_idx.size)]):
        members = np.flatnonzero(walk_idx == last).tolist()
        members.sort(key=lambda n: float(pieces[n].time_s[0]))
        walks[last] = end_to_end([pieces[n] for n in members])
        for member in members:
            if member != last:
                walks[member] = pieces[member].part(np.array([0]))
    return walks


def observe_each(trajectories: Sequence[Trajectory], intrinsics: Intrinsics) -> Observations:
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


def _rows(owner_idx: Index, run: Index, time_s: Array, count: int) -> Rows:
    linked: Mask = np.zeros(owner_idx.size, dtype=bool)
    linked[1:] = run[1:] == run[:-1]
    number = np.maximum(np.bincount(owner_idx, minlength=count), 1)
    # Sums of epoch seconds lose digits: count from each track's first row, whatever came before.
    first = np.searchsorted(owner_idx, owner_idx)
    since_s = time_s - time_s[first]
    middle_s = np.bincount(owner_idx, since_s, count) / number
    when = (since_s - middle_s[owner_idx]) / 10
    return Rows(owner_idx=owner_idx, linked=linked, time_s=time_s, when=when, owners=count)


def observe_heads(trajectories: Sequence[Trajectory], intrinsics: Intrinsics) -> HeadFootPairs:
    """The head-foot pairs of trajectories, one for each 1.5 s in which a head was seen twice.

    Points whose foot or head is outside the image or cut by its border, or whose head is below the
    foot or less than 8 pixels from it, are left out.
    """
    pieces: list[Array] = []
    owners: list[int] = []
    for owner, trajectory in enumerate(trajectories):
        found = _of_one(trajectory, intrinsics)
        pieces.append(found)
        owners += [owner] * len(found)
    rays = np.concatenate(pieces) if pieces else np.empty((0, 5, 3))
    return HeadFootPairs(
        foot_rays=rays[:, 0],
        head_rays=rays[:, 1],
        column_rays=rays[:, 2],
        from_rays=rays[:, 3],
        to_rays=rays[:, 4],
        owner_idx=np.array(owners, dtype=np.int64),
        owners=len(trajectories),
    )


def _of_one(trajectory: Trajectory, intrinsics: Intrinsics) -> Array:
    """Rays (M, 5, 3) to foot, head, above the foot, to the feet before and after."""
    if trajectory.head_uv is None:
        return np.empty((0, 5, 3))
    feet, heads = trajectory.uv, trajectory.head_uv
    known = np.asarray(np.isfinite(heads).all(axis=1) & intrinsics.shows_foot(feet))
    up = np.where(known[:, None], feet - heads, 0.0)
    known = known & uncut(intrinsics, np.nan_to_num(heads)) & (up[:, 1] > 0)
    known = known & (np.hypot(up[:, 0], up[:, 1]) >= config.SHORTEST_HEAD_PX)
    feet, heads = feet[known], heads[known]
    rays, valid = intrinsics.rays(
        np.stack([feet, heads, np.stack([feet[:, 0], heads[:, 1]], axis=1)], axis=1)
    )
    whole = np.asarray(valid.all(axis=1))
    rays = rays[whole]
    if len(rays) < config.HEAD_POINTS:
        return np.empty((0, 5, 3))
    time_s = trajectory.time_s[known][whole]
    place = ((time_s - time_s[0]) / config.STEP_S).astype(np.int64)
    firsts = np.flatnonzero(np.diff(place, prepend=-1))
    number = np.diff(np.append(firsts, place.size))
    mean = np.add.reduceat(rays, firsts, axis=0) / number[:, None, None]
    mean = mean[number >= config.HEAD_POINTS] if (number >= config.HEAD_POINTS).any() else mean
    before = mean[np.maximum(np.arange(len(mean)) - 1, 0), :1]
    after = mean[np.minimum(np.arange(len(mean)) + 1, len(mean) - 1), :1]
    return np.concatenate([mean, before, after], axis=1)
