"""How well two pictures tell a camera's turn: photographs, a real camera that moved, and the cost.

`python -m studies pictures FOLDER ...`: photographs are turned by what is known, in all weathers,
and pictures of one pose are compared with one another; trials that `--output` has are not made
again. With `--before` and `--after`, pictures of a real camera that moved, and the same turned by
0 to 5 deg; with `--cost`, the CPU time of a comparison alone.
"""

import argparse
import math
import time
from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from itertools import combinations
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from rich.console import Console

from models.pictures.features import Features, describe
from models.pictures.measures import Pixels
from models.pictures.turn import Turn, turn_between
from studies.lines_file import LinesFile
from studies.pages import markers, write_between
from studies.pictures.moves import MoveTrial, move_trials
from studies.pictures.tables import (
    cost_line,
    moves_table,
    pairs_table,
    real_table,
    turns_table,
)
from studies.pictures.trials import (
    PairTrial,
    TurnTrial,
    elsewhere,
    pair_trials,
    photographs,
    still_pictures,
    turn_trials,
)
from studies.pictures.weather import lens
from studies.runs import as_they_end, process_pool

COMMAND = "python -m studies pictures"
_AT_ONCE = 10  # trials of a task
STILL = 20  # pictures of one pose that are compared with one another
STRANGERS = 5  # pictures of other places
PAIRS_OF_A_ROUND = STILL * (STILL - 1) // 2


def main(arguments: Sequence[str]) -> None:
    """Run what is asked for, and print or write its tables."""
    asked = _parser().parse_args(arguments)
    cv2.setNumThreads(1)
    texts: dict[str, list[str]] = {}
    if asked.folders:
        made = [] if asked.cost else _of_photographs(asked)
        texts["pictures"] = [*made, cost_line(*_cost(photographs(asked.folders)))]
    if asked.before and asked.after:
        real = real_table(*_real(asked.before, asked.after, asked.focal_px))
        texts["real pictures"] = [real, moves_table(_moves(asked))]
    for name, parts in texts.items():
        text = "\n".join(parts)
        Console().print(text, markup=False, highlight=False, soft_wrap=True)
        if asked.write:
            write_between(asked.write, markers(name, COMMAND), text)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog=COMMAND, description=__doc__)
    parser.add_argument("folders", nargs="*", type=Path, help="of photographs")
    parser.add_argument("--turns", type=int, default=500, help="trials of a known turn")
    parser.add_argument("--pairs", type=int, default=10_000, help="of one pose, at least")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--before", nargs="*", type=Path, help="pictures of a real camera")
    parser.add_argument("--after", nargs="*", type=Path, help="and of it after it moved")
    parser.add_argument(
        "--moves", type=int, default=12, help="rounds of small known turns of these"
    )
    parser.add_argument("--focal-px", type=float, default=lens().fx, help="of that camera")
    parser.add_argument("--cost", action="store_true", help="the CPU time alone")
    parser.add_argument("--output", type=Path, default=Path("pictures.jsonl"), help="kept trials")
    parser.add_argument("--write", type=Path, help="a page with markers for the tables")
    return parser


def _of_photographs(asked: argparse.Namespace) -> list[str]:
    """The tables of all trials that are kept, after those that are missing have been made."""
    names = list(photographs(asked.folders))
    rounds = math.ceil(asked.pairs / PAIRS_OF_A_ROUND)
    tasks = {
        **{
            f"turns {first}": partial(_turns, asked.folders, first)
            for first in range(0, asked.turns, _AT_ONCE)
        },
        **{
            f"pairs {names[number % len(names)]} {number}": partial(
                _pairs, asked.folders, names[number % len(names)], number
            )
            for number in range(rounds)
        },
    }
    kept = LinesFile(asked.output)
    done = {str(row["task"]): row for row in kept.rows if "task" in row}
    missing = [name for name in tasks if name not in done]
    with process_pool(asked.processes) as pool:
        for number, row in as_they_end(pool, [tasks[name] for name in missing]):
            done[missing[number]] = {"task": missing[number], **row}
            kept.add([done[missing[number]]])
    rows = [done[name] for name in tasks]

    def all_of(part: str) -> list[Any]:
        return [each for row in rows for each in row.get(part, ())]

    turns = [TurnTrial(**each) for each in all_of("turns")]
    still, others = (
        [None if each is None else PairTrial(**each) for each in all_of(part)]
        for part in ("still", "others")
    )
    return [turns_table(turns), pairs_table(still, others)]


def _turns(folders: Sequence[Path], first: int) -> dict[str, Any]:
    cv2.setNumThreads(1)
    trials = turn_trials(photographs(folders), range(first, first + _AT_ONCE))
    return {"turns": [asdict(trial) for trial in trials]}


def _pairs(folders: Sequence[Path], name: str, seed: int) -> dict[str, Any]:
    """All pairs of some pictures of one pose, and each of these with a picture of another place."""
    cv2.setNumThreads(1)
    pictures = photographs(folders)
    named = still_pictures(pictures, name, STILL, seed)
    places = elsewhere(pictures, name)
    places = [places[(seed + number) % len(places)] for number in range(STRANGERS)]
    strangers = [(other, describe(pictures[other])) for other in places]
    still = pair_trials(named, list(combinations(range(STILL), 2)))
    between = [(number, STILL + number % STRANGERS) for number in range(STILL)]
    others = pair_trials([*named, *strangers], between)
    return {
        part: [None if trial is None else asdict(trial) for trial in trials]
        for part, trials in (("still", still), ("others", others))
    }


def _moves(asked: argparse.Namespace) -> list[MoveTrial]:
    """Trials of small known turns in real images of other hours; those that are kept stay."""
    kept = LinesFile(asked.output)
    done = [row for row in kept.rows if "moves" in row]
    missing = range(len(done), asked.moves)
    make = partial(move_trials, asked.before, asked.after, asked.focal_px)
    with process_pool(asked.processes) as pool:
        for _, trials in as_they_end(pool, [partial(make, number) for number in missing]):
            done.append({"moves": [asdict(trial) for trial in trials]})
            kept.add(done[-1:])
    return [MoveTrial(**each) for row in done[: asked.moves] for each in row["moves"]]


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
