"""What is read of tracks, each walk once: the pieces of one are put together first."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.reasons import Reason, TracksCode
from models.tracks.head_foot import observe_heads
from models.tracks.linking import link_pieces, walks_of
from models.tracks.observations import Observations
from models.tracks.observing import observe as observe_each
from models.tracks.trajectory import Trajectory, end_to_end

_MANY = 0.1  # of the tracks: so many pieces are worth a word


@dataclass(frozen=True, slots=True, kw_only=True)
class Walks:
    """What is read of N tracks, by the order that they were given in.

    `walk_idx` (N,) is the track that each counts with, the last piece of its walk: the steps, boxes
    and heads of a walk in several pieces are that one's, and the others have none.
    """

    observations: Observations
    walk_idx: npt.NDArray[np.int64]

    @property
    def pieces(self) -> int:
        """How many tracks are another's walk: they do not count by themselves."""
        return int((self.walk_idx != np.arange(self.walk_idx.size)).sum())

    @property
    def reason(self) -> Reason | None:
        """What is to be said of a tracker that cuts walks; None where it cuts few or none."""
        tracks = self.walk_idx.size
        if not tracks or self.pieces < _MANY * tracks:
            return None
        values = {"tracks": float(tracks), "pieces": float(self.pieces)}
        return Reason(code=TracksCode.PIECES, values=values)


def observe_walks(
    trajectories: Sequence[Trajectory],
    intrinsics: Intrinsics,
    pose: CameraPose,
    before: npt.NDArray[np.int64] | None = None,
) -> Walks:
    """What is read of tracks, each walk once.

    The same tracks give the same, in whatever portions they came.

    Args:
        trajectories: in the order of their ends.
        intrinsics: of the camera.
        pose: about where it stands, its prior pose.
        before: what `link_pieces` says of them, where that is known by now.
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


def _last_pieces(
    trajectories: Sequence[Trajectory], before: npt.NDArray[np.int64]
) -> npt.NDArray[np.int64]:
    """The last piece (N,) of each track's walk, by the piece before each."""
    first = walks_of(before)
    order = np.argsort([trajectory.time_s[0] for trajectory in trajectories], kind="stable")
    last = np.empty(before.size, dtype=np.int64)
    last[first[order]] = order  # of several the latest stays
    return last[first]


def _walks(pieces: Sequence[Trajectory], walk_idx: npt.NDArray[np.int64]) -> list[Trajectory]:
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
