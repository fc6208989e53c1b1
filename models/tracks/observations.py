"""Observations of tracks as values: steps of walkers, tops of their boxes, heads.

Nothing here depends on the pose.
"""

from dataclasses import dataclass, replace

import numpy as np

from models.errors import ShapeError
from models.geometry.rotation import Array, Index, Mask
from models.rows import rows_of


@dataclass(frozen=True, slots=True, kw_only=True)
class Rows:
    """Owners of M rows; the rows of a track stand together, in time order.

    `owner_idx` (M,) is the track, `linked` (M,) says that a row follows the one before it without
    a gap, `time_s` (M,) is when it was and `when` (M,) how long after the middle of its track's
    rows, in units of 10 s. `owners` is the number of tracks, with and without rows.
    """

    owner_idx: Index
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
    owner_idx: Index
    owners: int

    def __len__(self) -> int:
        return int(self.owner_idx.size)

    @property
    def tracks(self) -> Index:
        """The tracks (K,) that have heads, ascending."""
        return np.unique(self.owner_idx)

    def of_tracks(self, chosen: Index) -> "HeadFootPairs":
        """Those of some tracks only, given by ascending indices, which are numbered anew."""
        renumber = np.full(self.owners, -1)
        renumber[chosen] = np.arange(chosen.size)
        kept = renumber[self.owner_idx] >= 0
        owner_idx = renumber[self.owner_idx[kept]]
        return rows_of(self, kept, owner_idx=owner_idx, owners=int(chosen.size))


@dataclass(frozen=True, slots=True, kw_only=True)
class Observations:
    """All that is read of a set of tracks, and when each of them ended (tracks,).

    `heads` are None where nobody looked for any.
    """

    steps: Steps
    tops: Tops
    ended_s: Array
    tracks: int
    heads: HeadFootPairs | None = None

    @property
    def walkers(self) -> int:
        """The number of tracks with at least one step."""
        return int(np.unique(self.steps.rows.owner_idx).size)


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


def of_tracks(observations: Observations, chosen: Index) -> Observations:
    """The observations of some tracks only, given by ascending indices."""
    renumber = np.full(observations.tracks, -1)
    renumber[chosen] = np.arange(chosen.size)
    tops = observations.tops
    steps = steps_where(observations.steps, renumber[observations.steps.rows.owner_idx] >= 0)
    every = np.ones(len(steps.rows), dtype=bool)
    kept_tops = renumber[tops.rows.owner_idx] >= 0
    return Observations(
        steps=replace(steps, rows=_kept(steps.rows, every, renumber, chosen.size)),
        tops=rows_of(tops, kept_tops, rows=_kept(tops.rows, kept_tops, renumber, chosen.size)),
        ended_s=observations.ended_s[chosen],
        tracks=int(chosen.size),
        heads=None if observations.heads is None else observations.heads.of_tracks(chosen),
    )


def steps_where(steps: Steps, kept: Mask) -> Steps:
    """Some of the steps; one whose step before it is not among them is linked to none."""
    rows = steps.rows
    linked = rows.linked.copy()
    linked[1:] &= kept[:-1]
    return rows_of(steps, kept, rows=rows_of(replace(rows, linked=linked), kept))


def _kept(rows: Rows, kept: Mask, renumber: Index, owners: int) -> Rows:
    return rows_of(rows, kept, owner_idx=renumber[rows.owner_idx[kept]], owners=owners)
