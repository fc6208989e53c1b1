"""How well two pictures tell a camera's turn: photographs, a real camera that moved, and the cost.

`python -m studies pictures FOLDER ...`: photographs are turned by what is known, in all weathers;
pictures of one pose are compared with one another. With `--before` and `--after`, pictures of a
real camera that moved; with `--cost`, the CPU time of a comparison alone.
"""

import argparse
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import cv2
import numpy as np
from rich.console import Console

from models.pictures.features import Features, describe
from models.pictures.measures import Pixels
from models.pictures.turn import Turn, turn_between
from studies.pages import markers, write_between
from studies.pictures.tables import cost_line, pairs_table, real_table, turns_table
from studies.pictures.trials import (
    PairTrial,
    TurnTrial,
    pair_trials,
    photographs,
    still_pictures,
    turn_trials,
)
from studies.pictures.weather import lens
from studies.runs import as_they_end, process_pool

COMMAND = "python -m studies pictures"
_AT_ONCE = 25  # trials of a task
_SHARED = 0.5  # of the old view in sight


def main(arguments: Sequence[str]) -> None:
    """Run what is asked for, and print or write its tables."""
    asked = _parser().parse_args(arguments)
    cv2.setNumThreads(1)
    parts = []
    if asked.folders and not asked.cost:
        parts += [turns_table(_turns(asked)), pairs_table(*_pairs(asked))]
    if asked.before and asked.after:
        parts.append(real_table(*_real(asked.before, asked.after, asked.focal_px)))
    if asked.folders:
        parts.append(cost_line(*_cost(photographs(asked.folders))))
    text = "\n".join(parts)
    Console().print(text, markup=False, highlight=False, soft_wrap=True)
    if asked.write:
        write_between(asked.write, markers("pictures", COMMAND), text)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog=COMMAND, description=__doc__)
    parser.add_argument("folders", nargs="*", type=Path, help="of photographs")
    parser.add_argument("--turns", type=int, default=500, help="trials of a known turn")
    parser.add_argument("--still", type=int, default=40, help="pictures of each pose")
    parser.add_argument("--pairs", type=int, default=10_000, help="of one pose, at most")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--before", nargs="*", type=Path, help="pictures of a real camera")
    parser.add_argument("--after", nargs="*", type=Path, help="and of it after it moved")
    parser.add_argument("--focal-px", type=float, default=lens().fx, help="of that camera")
    parser.add_argument("--cost", action="store_true", help="the CPU time alone")
    parser.add_argument("--write", type=Path, help="a page with markers for the tables")
    return parser


def _turns(asked: argparse.Namespace) -> list[TurnTrial]:
    seeds = [
        range(asked.seed + first, asked.seed + min(first + _AT_ONCE, asked.turns))
        for first in range(0, asked.turns, _AT_ONCE)
    ]
    tasks = [partial(_some_turns, asked.folders, each) for each in seeds]
    with process_pool(asked.processes) as pool:
        return [trial for _, found in as_they_end(pool, tasks) for trial in found]


def _some_turns(folders: Sequence[Path], seeds: Sequence[int]) -> list[TurnTrial]:
    cv2.setNumThreads(1)
    return turn_trials(photographs(folders), seeds)


def _pairs(asked: argparse.Namespace) -> tuple[list[PairTrial | None], list[PairTrial | None]]:
    """Pairs of one pose, and as many of two scenes as there are photographs."""
    names = list(photographs(asked.folders))
    each = max(asked.pairs // len(names), 1)
    tasks = [
        partial(_some_pairs, asked.folders, name, asked.still, each, asked.seed + number)
        for number, name in enumerate(names)
    ]
    still: list[PairTrial | None] = []
    others: list[PairTrial | None] = []
    with process_pool(asked.processes) as pool:
        for _, (own, other) in as_they_end(pool, tasks):
            still += own
            others += other
    return still, others


def _some_pairs(
    folders: Sequence[Path], name: str, count: int, most: int, seed: int
) -> tuple[list[PairTrial | None], list[PairTrial | None]]:
    cv2.setNumThreads(1)
    pictures = photographs(folders)
    named = still_pictures(pictures, name, count, seed)
    strangers = [
        (other, describe(picture)) for other, picture in pictures.items() if other[:10] != name[:10]
    ]
    pairs = [(one, other) for one in range(count) for other in range(one + 1, count)]
    draw = np.random.default_rng(seed)
    chosen = [pairs[k] for k in draw.permutation(len(pairs))[:most].tolist()]
    between = [(number, count + number % len(strangers)) for number in range(count)]
    return pair_trials(named, chosen), pair_trials([*named, *strangers], between)


def _real(
    before: Sequence[Path], after: Sequence[Path], focal_px: float
) -> tuple[list[tuple[str, str, Turn | None]], float]:
    """The turns of each later picture against each before, and of the later against their first."""
    own = lens(focal_px)
    first, later = (
        [(path.stem, describe(_grey(path))) for path in paths] for paths in (before, after)
    )
    found = [
        (name, other, turn_between(features, seen, own))
        for name, features in [*first, later[0]]
        for other, seen in later
        if other != name
    ]
    return found, focal_px


def _grey(path: Path) -> Pixels:
    return np.asarray(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE), np.uint8)


def _cost(pictures: dict[str, Pixels]) -> tuple[float, float, int]:
    """CPU seconds of the features of a picture, and of a comparison; stored bytes."""
    features: list[Features] = []
    begun = time.process_time()
    for picture in pictures.values():
        features.append(describe(picture))
    described = time.process_time()
    for one in features:
        turn_between(features[0], one, lens())
    compared = time.process_time()
    count = len(features)
    size = int(np.median([len(each.to_bytes()) for each in features]))
    return (described - begun) / count, (compared - described) / count, size
