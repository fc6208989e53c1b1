"""Trackers that lose people and find them again under new names, or mix two of them up."""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.tracks.scenes import SceneTrack
from models.tracks.trajectory import Trajectory, end_to_end
from studies.faults.view import View, ground_of, own_rng

_SHORTEST, _LONGEST = 2 / 3, 4 / 3  # of a piece, of its mean length
_LOST = 1 / 6  # of the mean length: the longest time for which nobody is followed
_MEETING_M = 1.0


def fragments(tracks: Sequence[SceneTrack], view: View, size: float, seed: int) -> list[SceneTrack]:
    """Tracks cut in pieces of 2/3 to 4/3 of `size` seconds, each with an id of its own.

    Between pieces the person is lost for up to a sixth of `size`. The person's id stays, so that
    what links pieces can be checked by it.
    """
    return [
        piece for track in tracks for piece in _pieces(track, size, own_rng(track.track_id, seed))
    ]


def switches(tracks: Sequence[SceneTrack], view: View, size: float, seed: int) -> list[SceneTrack]:
    """Tracks whose ids two people exchange where they come within 1 m, in a share `size` of times.

    A pair meets once, where it is nearest. A track's person is whom it follows longest.
    """
    meetings = sorted(_meetings(tracks, view), key=lambda meeting: meeting.time_s)
    rng = np.random.default_rng(seed)
    carried = list(range(len(tracks)))  # the id that each person carries by now
    since = [-np.inf] * len(tracks)
    parts: dict[int, list[tuple[float, int, Trajectory]]] = {}

    def close(person: int, until_s: float) -> None:
        trajectory = tracks[person].trajectory
        rows = np.flatnonzero((trajectory.time_s >= since[person]) & (trajectory.time_s < until_s))
        if rows.size:
            part = trajectory.part(rows)
            parts.setdefault(carried[person], []).append((float(part.time_s[0]), person, part))

    for meeting in meetings:
        if rng.uniform() >= size:
            continue
        for person in meeting.people:
            close(person, meeting.time_s)
            since[person] = meeting.time_s
        one, other = meeting.people
        carried[one], carried[other] = carried[other], carried[one]
    for person in range(len(tracks)):
        close(person, np.inf)
    mixed = []
    for number, own in sorted(parts.items()):
        own.sort(key=lambda part: part[0])
        longest = max(own, key=lambda part: part[2].time_s.size)[1]
        joined = end_to_end([part for _, _, part in own])
        if joined.time_s.size >= 2:
            mixed.append(
                replace(tracks[number], trajectory=joined, person_id=tracks[longest].person_id)
            )
    return mixed


@dataclass(frozen=True, slots=True, kw_only=True)
class _Meeting:
    """Two tracks, by their places, where they are nearest to one another."""

    time_s: float
    people: tuple[int, int]


def _pieces(track: SceneTrack, size: float, rng: np.random.Generator) -> Iterator[SceneTrack]:
    time_s = track.trajectory.time_s
    from_s, number = float(time_s[0]), itertools.count()
    while from_s <= time_s[-1]:
        until_s = from_s + rng.uniform(_SHORTEST, _LONGEST) * size
        rows = np.flatnonzero((time_s >= from_s) & (time_s < until_s))
        if rows.size >= 2:
            yield replace(
                track,
                track_id=f"{track.track_id}.{next(number)}",
                trajectory=track.trajectory.part(rows),
            )
        from_s = until_s + rng.uniform(0, _LOST) * size


def _meetings(tracks: Sequence[SceneTrack], view: View) -> Iterator[_Meeting]:
    grounds = [ground_of(track, view)[0] for track in tracks]
    order = sorted(range(len(tracks)), key=lambda place: tracks[place].trajectory.time_s[0])
    there: list[int] = []
    for number in order:
        mine = tracks[number].trajectory.time_s
        there = [other for other in there if tracks[other].trajectory.time_s[-1] >= mine[0]]
        for other in there:
            theirs = tracks[other].trajectory.time_s
            rows = np.flatnonzero((mine > theirs[0]) & (mine <= theirs[-1]))
            rows = rows[rows > 0]  # both were there before they met
            if not rows.size:
                continue
            beside = [np.interp(mine[rows], theirs, grounds[other][:, axis]) for axis in (0, 1)]
            apart = np.linalg.norm(grounds[number][rows] - np.stack(beside, axis=1), axis=1)
            if np.isfinite(apart).any() and np.nanmin(apart) < _MEETING_M:
                nearest = rows[int(np.nanargmin(apart))]
                yield _Meeting(time_s=float(mine[nearest]), people=(other, number))
        there.append(number)
