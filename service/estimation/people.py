"""So many people's tracks, where a tracker gives some of them several: pieces of a walk are one."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np
import numpy.typing as npt

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.pose import link_pieces
from models.tracks.trajectory import Trajectory
from service.store.tracks import StoredTrack, seen_of, trajectory_of

# The store may give a deleted track's number to a new one.
_Track = tuple[int, datetime]


class Unpacked:
    """A cache of unpacked tracks; to be forgotten with the refresh."""

    def __init__(self) -> None:
        self._feet: dict[_Track, Trajectory] = {}
        self._seen: dict[_Track, tuple[Intrinsics, Trajectory]] = {}

    def feet(self, record: StoredTrack) -> Trajectory:
        """The foot points of a stored track."""
        track = (record.id, record.received_at)
        if track not in self._feet:
            self._feet[track] = trajectory_of(record)
        return self._feet[track]

    def seen(self, record: StoredTrack, intrinsics: Intrinsics) -> Trajectory:
        """The feet of a stored track, with the upper edges of its boxes or its heads, if any."""
        track = (record.id, record.received_at)
        lens, seen = self._seen.get(track, (None, None))
        if seen is None or (lens is not intrinsics and lens != intrinsics):
            seen = seen_of(record, self.feet(record), intrinsics)
            self._seen[track] = (intrinsics, seen)
        return seen


_SPARE = 40
MOST_PIECES = 5  # to a walk, on average: more tracks than that are not unpacked for an estimate


@dataclass(frozen=True, slots=True, kw_only=True)
class Gathered:
    """Tracks, and whether there are `enough`: of as many people as were wanted.

    `before` is the piece before each of a walk, as of `link_pieces`; None where nobody looked.
    """

    records: Sequence[StoredTrack]
    enough: bool
    before: npt.NDArray[np.int64] | None = None


def until_so_many(
    load: Callable[[int], Sequence[StoredTrack]],
    wanted: int,
    intrinsics: Intrinsics,
    prior: CameraPose,
    unpacked: Unpacked,
    *,
    newest: bool = False,
) -> Gathered:
    """The fewest tracks that are of so many people; all that there are where these are too few.

    One track more is never two people more, so that asking for as many more as are missing ends at
    the same tracks whenever it is asked. Five times as many tracks as people do in any case.

    Args:
        load: the first so many tracks, or the newest.
        wanted: people.
        intrinsics: of the camera.
        prior: about where it stands.
        unpacked: what was unpacked already, and will be.
        newest: whether the newest are loaded, which are the last in order; or the first.
    """
    limit, most = wanted, MOST_PIECES * wanted
    loaded = limit + max(limit // _SPARE, 1)  # most trackers cut few walks: once is enough
    every = load(loaded)
    while True:
        if limit > loaded:
            loaded = limit
            every = load(loaded)
        if len(every) < limit:
            return Gathered(records=every, enough=False)
        records = every[-limit:] if newest else every[:limit]
        before = link_pieces(
            [unpacked.seen(record, intrinsics) for record in records], intrinsics, prior
        )
        walks = int((before < 0).sum())
        if walks >= wanted or limit == most:
            return Gathered(records=records, enough=True, before=before)
        limit = min(limit + wanted - walks, most)
