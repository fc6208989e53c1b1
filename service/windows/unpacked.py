"""The tracks that a refresh has unpacked: each once, though several of its parts look at it."""

from datetime import datetime

from models.geometry.intrinsics import Intrinsics
from models.tracks.trajectory import Trajectory
from service.store.serialization import seen_of, trajectory_of
from service.store.stored_tracks import StoredTrack

# The store may give a deleted track's number to a new one.
_Track = tuple[int, datetime]


class Unpacked:
    """What was unpacked so far; to be forgotten with the refresh."""

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
