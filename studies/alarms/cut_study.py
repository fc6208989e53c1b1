"""Changes: windows of a camera that does not move among them, and windows in which it does.

Windows are runs of a recording's later people, as many as 400 of them, from a drawn moment on:
every other seen from where the camera stands, every other from where it was knocked to before all
of them. None should be cut. Then the last 40 people of windows as long as they can be, a third of
them at the most, are seen from a camera that was turned by 5 deg: each should be cut there.

    python -m studies cuts ../shared/scenes/*/ ../shared/long/atc_20121024
"""

import argparse
import math
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from multiprocessing import Pool
from pathlib import Path

import numpy as np

from models.geometry.pose import CameraPose
from models.pose import CameraSite, learn_site, observe
from models.pose.estimating import search_change
from models.simulation.poses import PoseOffset
from models.tracks.scenes import Scene, SceneTrack
from models.tracks.trajectory import Trajectory, by_end
from studies.protocol.partings import HALVES_IN_TIME, first_seen, part_people
from studies.recordings import load_recording

_REFERENCE, _WINDOW, _AFTER = 1000, 400, 40
_FEWEST = 24  # tracks of a window: there are twelve on either side of a cut
_FAR, _FAR_LOG, _TURN = math.radians(8), 0.15, math.radians(5)
TURNS = {
    "tilt": PoseOffset(tilt_rad=_TURN),
    "roll": PoseOffset(roll_rad=_TURN),
    "pan": PoseOffset(heading_rad=_TURN),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class CutOutcome:
    """A window of a scene: what was done, how many tracks it has, and where it was cut.

    `change` is the first track after the turn, None where nothing moved in the window.
    """

    scene: str
    done: str
    tracks: int
    change: int | None
    cut: int | None


def cut_outcomes(scene: Scene, windows: int, turns: int, seed: int) -> Iterator[CutOutcome]:
    """So many windows without a change, and so many with each turn."""
    rng = np.random.default_rng((seed, zlib.crc32(scene.scene_id.encode())))
    prior = scene.true_pose
    parts = part_people(scene, HALVES_IN_TIME, rng)
    known = [track.trajectory for track in first_seen(scene, parts.reference, prior, _REFERENCE)]
    site = learn_site(
        observe(by_end(known), scene.intrinsics, prior), scene.intrinsics, prior, chart=False
    )
    for number in range(windows):
        knocked = number % 2 == 1
        pose = _knock(rng).apply(prior) if knocked else prior
        seen = _seen(scene, _drawn(parts.later, rng), pose)
        if len(seen) >= _FEWEST:
            done = "knocked before" if knocked else "still"
            yield _looked_at(scene, done, seen, None, site)
    for number in range(turns * len(TURNS)):
        name = list(TURNS)[number % len(TURNS)]
        people = _drawn(parts.later, rng, shortest=_WINDOW)
        after = min(_AFTER, len(people) // 3)
        moved = TURNS[name].apply(prior)
        before, behind = people[:-after], people[-after:]
        one, other = _seen(scene, before, prior), _seen(scene, behind, moved)
        # Whoever was in the picture while it turned is lost.
        one = [track for track in one if track.time_s[-1] < behind[0].trajectory.time_s[0]]
        if min(len(one), len(other)) >= _FEWEST // 2:
            yield _looked_at(scene, name, [*one, *other], len(one), site)


def _looked_at(
    scene: Scene, done: str, seen: Sequence[Trajectory], change: int | None, site: CameraSite
) -> CutOutcome:
    found = search_change(observe(seen, scene.intrinsics, scene.true_pose), site)
    return CutOutcome(
        scene=scene.scene_id, done=done, tracks=len(seen), change=change, cut=found.change_idx
    )


def _knock(rng: np.random.Generator) -> PoseOffset:
    tilt, roll, pan = rng.uniform(-_FAR, _FAR, 3)
    log_height = rng.uniform(-_FAR_LOG, _FAR_LOG)
    return PoseOffset(tilt_rad=tilt, roll_rad=roll, heading_rad=pan, log_height=log_height)


def _drawn(
    later: Sequence[SceneTrack], rng: np.random.Generator, shortest: int = _FEWEST + 12
) -> Sequence[SceneTrack]:
    """A run of people, of a drawn length and from a drawn moment on."""
    longest = min(_WINDOW, len(later))
    length = int(rng.integers(min(shortest, longest), longest + 1))
    first = int(rng.integers(0, len(later) - length + 1))
    return later[first : first + length]


def _seen(scene: Scene, people: Sequence[SceneTrack], pose: CameraPose) -> list[Trajectory]:
    return by_end(track.trajectory for track in first_seen(scene, people, pose, None))


def _report_lines(outcomes: Sequence[CutOutcome]) -> Iterator[str]:
    for done in ("still", "knocked before"):
        each = [one for one in outcomes if one.done == done]
        cuts = [f"{one.scene} ({one.tracks})" for one in each if one.cut is not None]
        yield f"{done}: {len(cuts)} of {len(each)} windows cut {', '.join(cuts)}".rstrip()
    for done in TURNS:
        each = [one for one in outcomes if one.done == done]
        found = sum(one.cut is not None for one in each)
        by_scene = ", ".join(
            f"{scene} {sum(one.cut is not None for one in each if one.scene == scene)} of "
            f"{sum(one.scene == scene for one in each)}"
            for scene in sorted({one.scene for one in each})
        )
        yield f"turned in {done} by 5 deg: {found} of {len(each)} cut ({by_scene})"


def _outcomes_of(windows: int, turns: int, seed: int, place: tuple[Path, int]) -> list[CutOutcome]:
    folder, camera = place
    return list(cut_outcomes(load_recording(folder)[camera], windows, turns, seed))


def main(arguments: Sequence[str]) -> None:
    """Print how many windows were cut, without a change and with one."""
    parser = argparse.ArgumentParser("studies cuts", description=__doc__)
    parser.add_argument("recordings", type=Path, nargs="+")
    parser.add_argument("--windows", type=int, default=80, help="of each camera, without a change")
    parser.add_argument("--turns", type=int, default=8, help="of each camera, of each kind")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--processes", type=int, default=2)
    chosen = parser.parse_args(arguments)
    places = [
        (folder, camera)
        for folder in chosen.recordings
        for camera in range(len(load_recording(folder)))
    ]
    with Pool(chosen.processes) as pool:
        work = partial(_outcomes_of, chosen.windows, chosen.turns, chosen.seed)
        found = [one for each in pool.imap(work, places, chunksize=1) for one in each]
    for line in _report_lines(found):
        print(line)  # noqa: T201
