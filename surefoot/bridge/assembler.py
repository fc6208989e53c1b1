"""Frames in, whole tracks out: on an end, after a silence, or when there is no more room.

The same calls with the same times give the same tracks: a saved `state` and what came after it are
all that a restart needs. A detection that comes twice changes nothing, even after its track was
finished.
"""

from __future__ import annotations

import math
from array import array
from dataclasses import dataclass, field
from typing import Any

import msgspec

from surefoot.bridge.values import Detection, Ended, WholeTrack
from surefoot.people import SkipReason, skip_reason

_VERSION = 2
_COLUMNS = 5  # time and box
_RANKS = {None: 0, SkipReason.CONFIDENCE: 1, SkipReason.NOT_A_PERSON: 2}


class StateError(Exception):
    """Saved state that is none of this assembler's."""


class _Open(msgspec.Struct, array_like=True):
    camera: str
    track_id: str
    label: str | None
    size: tuple[float, float] | None
    heard_s: float  # by the clock of who assembles
    rows: Any  # array of floats; bytes where saved
    first_s: float = math.inf  # messages come out of turn
    last_s: float = -math.inf
    confidence: float | None = None


class _State(msgspec.Struct, array_like=True):
    version: int
    open: list[_Open]
    done: list[tuple[str, str, float, float]]


@dataclass(slots=True, kw_only=True)
class Assembler:
    """Tracks under way and finished ones; not for several threads at once.

    `silence_s` ends a track: by the clock of who assembles, and between two detections by theirs.
    Of open tracks the one that was heard of longest ago is finished where `max_tracks` or
    `max_points` would be exceeded; a point takes 40 bytes.
    """

    silence_s: float = 5.0
    max_tracks: int = 20_000
    max_points: int = 1_000_000
    max_track_points: int = 10_000  # what the service takes
    max_track_s: float = 3_600.0
    _open: dict[tuple[str, str], _Open] = field(default_factory=dict)  # longest unheard first
    _finished: list[WholeTrack] = field(default_factory=list)
    # First and last time of what was finished last: brokers send again what was not acknowledged.
    _done: dict[tuple[str, str], tuple[float, float]] = field(default_factory=dict)
    _open_points: int = 0

    @property
    def open_tracks(self) -> int:
        """How many tracks are under way."""
        return len(self._open)

    def add(self, found: Detection | Ended, now_s: float) -> None:
        """Take in what an adapter found; `now_s` is the caller's time (time.time())."""
        if isinstance(found, Ended):
            self._finish((found.camera, found.track_id))
        else:
            self._detected(found, now_s)

    def tick(self, now_s: float) -> None:
        """Finish the tracks of which nothing was heard for `silence_s`."""
        while self._open:
            key = next(iter(self._open))
            # A clock that was set back makes nothing last for ever.
            if abs(now_s - self._open[key].heard_s) < self.silence_s:
                return
            self._finish(key)

    def finish_all(self) -> None:
        """Finish every track, at the end of a file."""
        for key in list(self._open):
            self._finish(key)

    def take(self) -> list[WholeTrack]:
        """The tracks that were finished since they were taken last."""
        taken, self._finished = self._finished, []
        return taken

    def hear_all(self, now_s: float) -> None:
        """Count all silences from now: what came while nobody listened is still to be heard."""
        for each in self._open.values():
            each.heard_s = now_s

    def state(self) -> bytes:
        """All that was added and not finished, to be saved once what is finished was taken."""
        opened = [
            msgspec.structs.replace(each, rows=each.rows.tobytes()) for each in self._open.values()
        ]
        done = [(*key, *times) for key, times in self._done.items()]
        return msgspec.msgpack.encode(_State(_VERSION, opened, done))

    def restore(self, saved: bytes) -> None:
        """Go on from a saved state, in place of what is there.

        Raises:
            StateError: it is none, or broken.
        """
        try:
            found = msgspec.msgpack.decode(saved, type=_State)
            if found.version != _VERSION:
                raise ValueError(f"version {_VERSION} is needed, got {found.version}")
            opened = {(each.camera, each.track_id): each for each in found.open}
            for each in found.open:
                each.rows = _rows(each.rows, _COLUMNS)
                each.first_s, each.last_s = min(each.rows[::_COLUMNS]), max(each.rows[::_COLUMNS])
        except (msgspec.MsgspecError, ValueError, TypeError) as error:
            raise StateError(f"no saved state of an assembler: {error}") from error
        self._open, self._finished = opened, []
        self._done = {(camera, name): (first, last) for camera, name, first, last in found.done}
        self._open_points = sum(len(each.rows) // _COLUMNS for each in opened.values())

    def _detected(self, found: Detection, now_s: float) -> None:
        key = (found.camera, found.track_id)
        first_s, last_s = self._done.get(key, (math.inf, -math.inf))
        if first_s <= found.time_s <= last_s:
            return
        track = self._open.get(key)
        if track is not None and self._is_another(track, found):
            self._finish(key)
            track = None
        if track is None:
            track = _Open(found.camera, found.track_id, found.label, found.size, now_s, array("d"))
            track.confidence = found.confidence
        else:
            del self._open[key]  # to the end: heard of last
        self._open[key] = track
        track.heard_s = now_s
        if track.rows and not self._is_used(track, found):
            return
        track.rows.extend((found.time_s, *found.box))
        track.first_s = min(track.first_s, found.time_s)
        track.last_s = max(track.last_s, found.time_s)
        self._open_points += 1
        while len(self._open) > self.max_tracks or self._open_points > self.max_points:
            self._finish(next(iter(self._open)))

    def _is_used(self, track: _Open, found: Detection) -> bool:
        """Return False for a detection to leave out of a track that has better ones.

        A detector may change its mind: a track keeps the detections of a person that are to be
        used, and has others only while it has none of those. A table of text is read the same way.
        """
        has, comes = _rank(track.label, track.confidence), _rank(found.label, found.confidence)
        if comes < has:
            self._open_points -= len(track.rows) // _COLUMNS
            track.label, track.confidence, track.rows = found.label, found.confidence, array("d")
            track.first_s, track.last_s = math.inf, -math.inf
        return comes <= has

    def _is_another(self, track: _Open, found: Detection) -> bool:
        """True where a known id is of somebody else, or seen in another picture, by now."""
        first_s, last_s = min(track.first_s, found.time_s), max(track.last_s, found.time_s)
        # Within it is what was sent again, however long ago that was.
        return (
            max(track.first_s - first_s, last_s - track.last_s) > self.silence_s
            or last_s - first_s > self.max_track_s
            or found.size != track.size
            or len(track.rows) >= self.max_track_points * _COLUMNS
        )

    def _finish(self, key: tuple[str, str]) -> None:
        track = self._open.pop(key, None)
        if track is None:
            return
        self._open_points -= len(track.rows) // _COLUMNS
        rows = _in_order(track.rows)
        self._done.pop(key, None)
        self._done[key] = (rows[0], rows[-_COLUMNS])
        if len(self._done) > self.max_tracks:
            del self._done[next(iter(self._done))]
        whole = WholeTrack(*key, track.label, "boxes", rows, track.size, track.confidence)
        self._finished.append(whole)


def _rank(label: str | None, confidence: float | None) -> int:
    """Return 0 for a detection to be used, else how far it is from being one."""
    return _RANKS[skip_reason(label, confidence)]


def _in_order(rows: array[float]) -> array[float]:
    """The rows by time, each time once: messages come twice, and out of turn."""
    by_time = {rows[at]: rows[at : at + _COLUMNS] for at in range(0, len(rows), _COLUMNS)}
    ordered = array("d")
    for time_s in sorted(by_time):
        ordered.extend(by_time[time_s])
    return ordered


def _rows(saved: Any, columns: int) -> array[float]:
    if not isinstance(saved, bytes):
        raise ValueError(f"rows: bytes are needed, got {type(saved).__name__}")
    rows = array("d")
    rows.frombytes(saved)
    if not rows or len(rows) % columns:
        raise ValueError(f"rows: rows of {columns} numbers are needed, got {len(rows)}")
    return rows
