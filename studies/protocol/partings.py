"""Partings of a recording's people into reference and test: in time, or at random."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from models.durations import HOUR_S
from models.geometry.pose import CameraPose
from models.simulation.poses import offset_trajectory
from models.tracks.scenes import Scene, SceneTrack

_NIGHT_S = 4 * HOUR_S  # without anybody: another day begins


class Split(StrEnum):
    """Parting of people: the earlier from the later, or by lot."""

    TIME = "time"
    PEOPLE = "people"


@dataclass(frozen=True, slots=True, kw_only=True)
class Parting:
    """A split, and how many tracks are taken on either side of it; all unless it is said.

    The reference is its first `reference_tracks`; of the others, `seen_tracks` after one another
    from a drawn moment on.
    """

    split: Split
    reference_tracks: int | None = None
    seen_tracks: int | None = None


HALVES_OF_PEOPLE = Parting(split=Split.PEOPLE)
HALVES_IN_TIME = Parting(split=Split.TIME)


@dataclass(frozen=True, slots=True, kw_only=True)
class Parts:
    """The tracks of two parts of a scene's people, each by their first times; nobody is in both."""

    reference: tuple[SceneTrack, ...]
    later: tuple[SceneTrack, ...]


def part_people(scene: Scene, parting: Parting, rng: np.random.Generator) -> Parts:
    """A scene's people in two parts.

    In time, the earlier half is the reference; where the recording has nights, when nobody comes
    for four hours, the half ends at the night nearest to its middle: other days come after it.
    """
    people = sorted({track.person_id for track in scene.tracks})
    drawn = rng.permutation(len(people))  # in any case: what is drawn next is the same
    if parting.split == Split.PEOPLE:
        first = {people[index] for index in drawn[: len(people) // 2]}
    else:
        first = _earlier(scene)
    return Parts(
        reference=tuple(track for track in scene.tracks if track.person_id in first),
        later=tuple(track for track in scene.tracks if track.person_id not in first),
    )


def first_seen(
    scene: Scene, tracks: Sequence[SceneTrack], pose: CameraPose | None, count: int | None
) -> list[SceneTrack]:
    """The first tracks that are long enough as a pose sees them; as recorded, where it is None."""
    found: list[SceneTrack] = []
    for track in tracks:
        if count is not None and len(found) >= count:
            break
        seen = track.trajectory
        if pose is not None:
            moved = offset_trajectory(seen, scene.intrinsics, scene.true_pose, pose)
            if moved is None:
                continue
            seen = moved
        if seen.long_enough:
            found.append(replace(track, trajectory=seen))
    return found


def _earlier(scene: Scene) -> set[str]:
    """People of the earlier half, or of the days before the night nearest to its end."""
    came: dict[str, float] = {}
    for track in scene.tracks:
        since = float(track.trajectory.time_s[0])
        came[track.person_id] = min(since, came.get(track.person_id, since))
    people = sorted(came, key=lambda person: (came[person], person))
    nights = 1 + np.flatnonzero(np.diff([came[person] for person in people]) > _NIGHT_S)
    half = len(people) // 2
    if nights.size:
        half = int(nights[np.abs(nights - half).argmin()])
    return set(people[:half])
