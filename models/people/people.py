"""From tracks to people: pieces put together, what stands or rides set aside, bad feet left out."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from models.estimation.joint.observations import (
    Observations,
    Tops,
    observe,
    steps_where,
)
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Mask
from models.people.feet import at_border, hidden
from models.people.kinds import ASKED, KINDS, Kind, kinds_of
from models.people.likely import likely_pose
from models.people.linking import link_pieces, walks_of
from models.trajectory import Trajectory


@dataclass(frozen=True, slots=True, kw_only=True)
class People:
    """What became of N tracks.

    `walk_idx` (N,) is the track that each counts with: the last piece of its walk. `kind_idx` (N,)
    is the place in `KINDS` of what it is of; pieces have their walk's. `hidden_steps` were left
    out since feet were hidden.
    """

    walk_idx: npt.NDArray[np.int64]
    kind_idx: npt.NDArray[np.int64]
    hidden_steps: int

    @property
    def linked(self) -> int:
        """How many tracks go on as others: pieces that do not count by themselves."""
        return int((self.walk_idx != np.arange(self.walk_idx.size)).sum())

    def count(self, kind: Kind) -> int:
        """How many people, or things, of a kind there are; the pieces of one count once."""
        ends = self.walk_idx == np.arange(self.walk_idx.size)
        return int((ends & (self.kind_idx == KINDS.index(kind))).sum())


@dataclass(frozen=True, slots=True, kw_only=True)
class Seen:
    """What is read of tracks, by the order that they were given in, and who they are.

    The steps of a walk in several pieces are those of its last one. Tracks of what rides, or of a
    tracker's mistakes, have no steps.
    """

    observations: Observations
    people: People


def see_people(
    trajectories: Sequence[Trajectory], intrinsics: Intrinsics, pose: CameraPose
) -> Seen:
    """The people among tracks, each once.

    The same tracks give the same, in whatever portions they came. The pose need only be about
    right: who is a walker is told by those around them.

    Args:
        trajectories: in the order of their ends.
        intrinsics: of the camera.
        pose: about where it stands, its prior pose.
    """
    ended_s = np.array([trajectory.time_s[-1] for trajectory in trajectories], dtype=np.float64)
    walk_idx = _last_pieces(trajectories, link_pieces(trajectories, intrinsics, pose))
    walks = _walks(_whole(trajectories, intrinsics, pose), walk_idx)
    found = replace(observe(walks, intrinsics), ended_s=ended_s)
    likely = likely_pose(found, pose)
    no_feet, short = hidden(found, likely)
    found = _where(found, ~no_feet, ~short)
    kind_idx = kinds_of(found, likely)
    asked = np.isin(kind_idx, [KINDS.index(kind) for kind in ASKED])
    return Seen(
        observations=_where(
            found, asked[found.steps.rows.owner_idx], asked[found.tops.rows.owner_idx]
        ),
        people=People(
            walk_idx=walk_idx, kind_idx=kind_idx[walk_idx], hidden_steps=int(no_feet.sum())
        ),
    )


def _last_pieces(
    trajectories: Sequence[Trajectory], before: npt.NDArray[np.int64]
) -> npt.NDArray[np.int64]:
    """The last piece (N,) of each track's walk, by the piece before each."""
    first = walks_of(before)
    order = np.argsort([trajectory.time_s[0] for trajectory in trajectories], kind="stable")
    last = np.empty(before.size, dtype=np.int64)
    last[first[order]] = order  # of several the latest stays
    return last[first]


def _whole(
    trajectories: Sequence[Trajectory], intrinsics: Intrinsics, pose: CameraPose
) -> list[Trajectory]:
    """Tracks without the points at the border; of one that is all there, its last point."""
    return [
        _part(trajectory, ~cut)
        for trajectory, cut in zip(
            trajectories, at_border(trajectories, intrinsics, pose), strict=True
        )
    ]


def _part(trajectory: Trajectory, kept: Mask) -> Trajectory:
    if kept.all():
        return trajectory
    indices = np.flatnonzero(kept)
    return trajectory.part(indices if indices.size else np.array([kept.size - 1]))


def _walks(pieces: Sequence[Trajectory], walk_idx: npt.NDArray[np.int64]) -> list[Trajectory]:
    """Whole walks in the places of their last pieces; a point, no walk, in those of the others."""
    walks = list(pieces)
    for last in np.unique(walk_idx[walk_idx != np.arange(walk_idx.size)]):
        members = np.flatnonzero(walk_idx == last).tolist()
        members.sort(key=lambda n: float(pieces[n].time_s[0]))
        walks[last] = _one_of([pieces[n] for n in members])
        for member in members:
            if member != last:
                walks[member] = pieces[member].part(np.array([0]))
    return walks


def _one_of(pieces: Sequence[Trajectory]) -> Trajectory:
    tops = None
    if any(piece.top_v is not None for piece in pieces):
        tops = np.concatenate(
            [np.full(p.time_s.size, np.nan) if p.top_v is None else p.top_v for p in pieces]
        )
    return Trajectory(
        time_s=np.concatenate([piece.time_s for piece in pieces]),
        uv=np.concatenate([piece.uv for piece in pieces]),
        top_v=tops,
    )


def _where(found: Observations, steps: Mask, tops: Mask) -> Observations:
    """Some of the steps and of the boxes; a row whose neighbour is gone is linked to none."""
    if steps.all() and tops.all():
        return found
    rows = found.tops.rows
    linked = rows.linked.copy()
    linked[1:] &= tops[:-1]
    return replace(
        found,
        steps=steps_where(found.steps, steps),
        tops=Tops(
            foot_rays=found.tops.foot_rays[tops],
            top_y=found.tops.top_y[tops],
            rows=replace(
                rows,
                owner_idx=rows.owner_idx[tops],
                linked=linked[tops],
                time_s=rows.time_s[tops],
                when=rows.when[tops],
            ),
        ),
    )
