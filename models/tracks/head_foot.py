"""What is read of heads: rays to a foot and to the head above it, and whose they are.

Nothing here depends on the pose.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array
from models.geometry.upright import uncut
from models.tracks.trajectory import Trajectory

STEP_S = 1.5  # a stride and more: who sways with their steps stands upright on average
_SHORTEST_PX = 8.0  # from foot to head: of less, half a pixel is more than people lean
_FEWEST_POINTS = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadFootPairs:
    """People upright for 1.5 s each: rays (M, 3), z = 1, in the camera frame, undistorted.

    `foot_rays` and `head_rays` are means over that time. `column_rays` are to the pixels right
    above the feet, at the heads' v: where heads would be had nobody seen them beside their feet.
    `from_rays` and `to_rays` are the same walker's feet before and after. `owner_idx` (M,) is the
    track, in ascending order, `owners` the number of tracks, with heads and without.
    """

    foot_rays: Array
    head_rays: Array
    column_rays: Array
    from_rays: Array
    to_rays: Array
    owner_idx: npt.NDArray[np.int64]
    owners: int

    def __len__(self) -> int:
        return int(self.owner_idx.size)

    @property
    def tracks(self) -> npt.NDArray[np.int64]:
        """The tracks (K,) that have heads, ascending."""
        return np.unique(self.owner_idx)

    def of_tracks(self, chosen: npt.NDArray[np.int64]) -> "HeadFootPairs":
        """Those of some tracks only, given by ascending indices, which are numbered anew."""
        renumber = np.full(self.owners, -1)
        renumber[chosen] = np.arange(chosen.size)
        kept = renumber[self.owner_idx] >= 0
        return HeadFootPairs(
            foot_rays=self.foot_rays[kept],
            head_rays=self.head_rays[kept],
            column_rays=self.column_rays[kept],
            from_rays=self.from_rays[kept],
            to_rays=self.to_rays[kept],
            owner_idx=renumber[self.owner_idx[kept]],
            owners=int(chosen.size),
        )


def observe_heads(trajectories: Sequence[Trajectory], intrinsics: Intrinsics) -> HeadFootPairs:
    """The pairs of trajectories, one for each 1.5 s in which a head was seen twice.

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
    known = known & (np.hypot(up[:, 0], up[:, 1]) >= _SHORTEST_PX)
    feet, heads = feet[known], heads[known]
    rays, valid = intrinsics.rays(
        np.stack([feet, heads, np.stack([feet[:, 0], heads[:, 1]], axis=1)], axis=1)
    )
    whole = np.asarray(valid.all(axis=1))
    rays = rays[whole]
    if len(rays) < _FEWEST_POINTS:
        return np.empty((0, 5, 3))
    time_s = trajectory.time_s[known][whole]
    place = ((time_s - time_s[0]) / STEP_S).astype(np.int64)
    firsts = np.flatnonzero(np.diff(place, prepend=-1))
    number = np.diff(np.append(firsts, place.size))
    mean = np.add.reduceat(rays, firsts, axis=0) / number[:, None, None]
    mean = mean[number >= _FEWEST_POINTS] if (number >= _FEWEST_POINTS).any() else mean
    before = mean[np.maximum(np.arange(len(mean)) - 1, 0), :1]
    after = mean[np.minimum(np.arange(len(mean)) + 1, len(mean) - 1), :1]
    return np.concatenate([mean, before, after], axis=1)
