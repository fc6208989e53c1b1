"""Study of what people tell of a lens: of scenes whose focal length is known, and believed wrong.

Of up to 200 people of each camera, by points alone, the pose is fitted with focal lengths from
half to twice the true one (`self_calibrate`); each is as likely as its best pose. `behind` is by
how much the log posterior of a believed focal length is behind that of the best one: a hint would
be given from a level on. At a factor of 1 each hint is false.

    python -m studies lens --scenes ../shared/scenes/*/ ../shared/long/lincoln_corridor/
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from models.errors import TooFewTrajectoriesError
from models.pose import self_calibrate
from models.simulation.walkers import WalkConfig
from models.tracks.scenes import Scene
from models.tracks.trajectory import Trajectory, by_end
from studies.recordings import load_recording

_FACTORS = (0.5, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.3, 1.5, 2.0)
_MOST_TRACKS, _SHARE = 200, 0.7  # of a scene's people, by chance
_LEVELS = (5.0, 8.0, 12.0, 20.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class LensOutcome:
    """By how much each focal length (F,) is behind the best one, in log posterior."""

    place: str
    tracks: int
    behind: tuple[float, ...]


def outcome_of(scene: Scene, tracks: Sequence[Trajectory]) -> LensOutcome:
    """What some people of a scene say of its lens; out of reach is infinitely far behind."""
    seen = [replace(track, top_v=None, head_uv=None) for track in by_end(tracks)]
    found = np.array([_log_posterior(scene, seen, factor) for factor in _FACTORS])
    behind = tuple(float(each) for each in found.max() - found)
    return LensOutcome(place=scene.scene_id, tracks=len(seen), behind=behind)


def _log_posterior(scene: Scene, tracks: Sequence[Trajectory], factor: float) -> float:
    own = scene.intrinsics
    lens = replace(own, fx=factor * own.fx, fy=factor * own.fy)
    try:
        return self_calibrate(tracks, lens, WalkConfig(), {}).log_posterior
    except TooFewTrajectoriesError:
        return -np.inf


def draws_of(scene: Scene, seeds: int) -> list[list[Trajectory]]:
    """People of a scene: of a short one by chance, of a long one those of an hour or so."""
    whole = by_end(each.trajectory for each in scene.tracks if each.trajectory.long_enough)
    if len(whole) > 5 * _MOST_TRACKS:
        begins = (seed * len(whole) // seeds for seed in range(seeds))
        return [whole[begin : begin + _MOST_TRACKS] for begin in begins]
    count = min(_MOST_TRACKS, int(_SHARE * len(whole)) + 1)
    drawn = (np.random.default_rng(seed).permutation(len(whole))[:count] for seed in range(seeds))
    return [[whole[number] for number in numbers] for numbers in drawn]


def main(arguments: Sequence[str]) -> None:
    """Print how far behind each focal length is, and what share of them is told from a level on."""
    parser = argparse.ArgumentParser("studies lens", description=__doc__)
    parser.add_argument("--seeds", type=int, default=3, help="draws of each camera's people")
    parser.add_argument("--scenes", type=Path, nargs="+", required=True)
    chosen = parser.parse_args(arguments)
    outcomes = []
    for scene in (scene for folder in chosen.scenes for scene in load_recording(folder)):
        for tracks in draws_of(scene, chosen.seeds):
            outcomes.append(outcome_of(scene, tracks))
            last = outcomes[-1]
            numbers = " ".join(f"{each:6.1f}" for each in last.behind)
            sys.stdout.write(f"{last.place:26} {last.tracks:4} {numbers}\n")
            sys.stdout.flush()
    behind = np.array([each.behind for each in outcomes])
    sys.stdout.write(f"{'factor':31} {' '.join(f'{each:6.1f}' for each in _FACTORS)}\n")
    for level in _LEVELS:
        told = " ".join(f"{100 * each:5.0f}%" for each in (behind >= level).mean(axis=0))
        sys.stdout.write(f"told from {level:4.0f} on, of {len(behind):4}      {told}\n")
