"""How soon the score test notices a pan, and how often it is wrong: `python -m ... SCENE_DIR...`.

By the protocol's halves: one is the reference, the people of the other are drawn some parties after
one another, as a turned camera sees them, until the test fires. For the false alarms each still
half is one window as it is, so that windows are as independent as the halves are.
"""

import argparse
import math
from pathlib import Path

import numpy as np
from rich.console import Console

from models.estimation.joint.observations import observe
from models.evaluation.protocol import KnockRange, draw_case
from models.evaluation.scenes import Knock, knock_trajectory, load_scene
from models.evaluation.study_site import draw_place, seen_from
from models.flow.evidence import walkers_of
from models.flow.move import party_scores
from models.flow.reference import candidate_of, learn_flow

_RATE = 1e-4
_RATES = (0.1, 0.01, 0.001, _RATE)
_PANS = (5.0, -5.0, 2.0, -2.0)
_DRAWS, _BLOCK, _MOST = 20, 3, 300
_STILL = KnockRange(angle_rad=0.0, log_height=0.0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", type=Path)
    parser.add_argument("--seeds", type=int, default=12)
    parser.add_argument("--sites", type=int, default=0, help="simulated ones, for false alarms")
    asked = parser.parse_args()
    out = Console(highlight=False, soft_wrap=True).print
    rng = np.random.default_rng(0)
    largest: list[list[bool]] = []
    medians = []
    for number in range(asked.sites):
        _simulated(number, largest)
    for folder in asked.scenes:
        found: dict[float, list[float]] = {pan: [] for pan in _PANS}
        for seed in range(asked.seeds):
            _one(folder, seed, rng, found, largest)
        if found[_PANS[0]]:
            row = [float(np.median(found[pan])) for pan in _PANS]
            medians.append(row)
            out(f"{folder.name:26s}", *(f"{n:7.0f}" for n in row))
    if medians:
        out(f"{'median of the scenes':26s}", *(f"{n:7.0f}" for n in np.median(medians, axis=0)))
        out(f"tracks until a pan of {', '.join(f'{pan:+g}' for pan in _PANS)} deg; inf: never")
    for number, rate in enumerate(_RATES):
        share = np.mean([values[number] for values in largest])
        out(f"still: {share:.4f} of {len(largest)} windows fire where {rate:g} may")


def _one(folder, seed, rng, found, largest) -> None:
    scene = load_scene(folder)
    case = draw_case(scene, seed, _STILL)
    flow = learn_flow(
        observe(case.reference, case.intrinsics), case.intrinsics, case.prior_pose, seed
    )
    if flow is None:
        return
    at, site = candidate_of(case.prior_pose), flow.site(case.intrinsics)
    for pan in (0.0, *_PANS):
        knock = Knock(tilt_rad=0, roll_rad=0, log_height=0, heading_rad=math.radians(pan))
        moved = knock.apply(scene.true_pose)
        tracks = [
            knock_trajectory(track, scene.intrinsics, scene.true_pose, moved) for track in case.seen
        ]
        kept = [track for track in tracks if track is not None and track.long_enough]
        walkers = walkers_of(observe(kept, case.intrinsics), at)
        scores, _ = party_scores(walkers, site, at)
        if pan == 0:
            top = flow.still.squares(scores).max()
            largest.append([top > flow.still.level(rate) for rate in _RATES])
            continue
        for _ in range(_DRAWS):
            starts = rng.integers(0, len(scores), -(-_MOST // _BLOCK))
            drawn = scores[(starts[:, None] + np.arange(_BLOCK)).ravel() % len(scores)]
            found[pan].append(_until(drawn, flow.still) * walkers.people / len(scores))


def _simulated(number, largest) -> None:
    """Windows of 100 people of a simulated site whose camera stands, after 200 for its map."""
    rng = np.random.default_rng([7, number])
    place = draw_place(rng)
    known, still = (seen_from(place, place.prior, count, rng) for count in (200, 6000))
    flow = learn_flow(known, place.intrinsics, place.prior, 0)
    at = candidate_of(place.prior)
    scores, _ = party_scores(walkers_of(still, at), flow.site(place.intrinsics), at)
    for first in range(0, len(scores) - 99, 100):
        top = flow.still.squares(scores[first : first + 100]).max()
        largest.append([top > flow.still.level(rate) for rate in _RATES])


def _until(scores, still) -> float:
    """Parties until the test fires."""
    for count in range(8, len(scores) + 1):
        if still.squares(scores[:count]).max() > still.level(_RATE):
            return float(count)
    return math.inf


if __name__ == "__main__":
    main()
