"""`evaluate`: the protocol on recorded scenes, in parallel; table, JSON, plots."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from itertools import product
from pathlib import Path

from rich.console import Console

from models.errors import ShapeError
from models.tracks.scenes import load_scene
from studies.protocol.cases import (
    RANGES,
    Answer,
    Estimator,
    Outcome,
    ProtocolCase,
    draw_case,
    judge_answer,
)
from studies.protocol.error_plots import draw_plots
from studies.protocol.estimators import UNTRAINED
from studies.protocol.learned import learn_case
from studies.protocol.report import by_scene, overall
from studies.protocol.tables import TABLE_WIDTH, overall_table, scene_table
from studies.runs import process_pool, with_bar, write_results


@dataclass(frozen=True, slots=True, kw_only=True)
class _Task:
    """Some cases of one scene: one seed of a range, or all of both for trained estimators."""

    folder: Path
    knocks: tuple[str, ...]
    seeds: tuple[int, ...]
    trained: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class _Result:
    """An outcome and the range that its knock was drawn from."""

    knock: str
    outcome: Outcome


def run_protocol(
    folders: Sequence[Path],
    *,
    seeds: int,
    knocks: Sequence[str],
    regressors: bool,
    processes: int,
    output: Path,
    plots: Path | None,
) -> None:
    """Offset each scene's camera, run every estimator, print tables, write JSON and plots.

    The JSON grows as cases end, so an interrupted evaluation keeps what it has.

    Raises:
        ShapeError: a knock has no such name, or a scene cannot be read.
    """
    for knock in knocks:
        if knock not in RANGES:
            raise ShapeError(f"knocks: {', '.join(RANGES)} are known, got {knock!r}")
    for folder in folders:
        load_scene(folder)
    console = Console(width=max(Console().width, TABLE_WIDTH))
    started = time.monotonic()
    tasks = _tasks(folders, seeds, knocks, regressors)
    results: list[_Result] = []
    cases = [len(task.knocks) * len(task.seeds) for task in tasks]
    with process_pool(processes) as pool:
        for found in with_bar(pool, [partial(_run, task) for task in tasks], console, cases=cases):
            results += found
            _write(output, results)
        order = {load_scene(folder).scene_id: place for place, folder in enumerate(folders)}
        results.sort(key=lambda r: (order[r.outcome.scene_id], r.outcome.seed))
        _write(output, results)
        by_knock = {k: [r.outcome for r in results if r.knock == k] for k in knocks}
        for knock, own in by_knock.items():
            console.print(scene_table(knock, seeds, by_scene(own)))
            console.print(overall_table(knock, overall(own)))
        console.print(f"{output} has every case; {time.monotonic() - started:.0f} s in all")
        if plots is not None:
            draw_plots(plots, folders, seeds, by_knock, pool)
            console.print(f"{plots} has the plots; {time.monotonic() - started:.0f} s in all")


def _tasks(
    folders: Sequence[Path], seeds: int, knocks: Sequence[str], regressors: bool
) -> list[_Task]:
    every = tuple(range(seeds))
    trained = [
        _Task(folder=folder, knocks=tuple(knocks), seeds=every, trained=True) for folder in folders
    ]
    single = [
        _Task(folder=folder, knocks=(knock,), seeds=(seed,), trained=False)
        for folder, knock, seed in product(folders, knocks, every)
    ]
    return [*(trained if regressors else []), *single]  # the longest first


def _run(task: _Task) -> list[_Result]:
    scene = load_scene(task.folder)
    trained: dict[str, Estimator] = {}
    if task.trained:
        from studies.protocol.regressors import prepare_regressors

        trained = prepare_regressors(scene, seed=0)
    results = []
    for knock, seed in product(task.knocks, task.seeds):
        case = draw_case(scene, seed, RANGES[knock])
        for name, ask in _asked(case, trained).items():
            started = time.monotonic()
            answer = ask()
            outcome = judge_answer(case, name, answer, time.monotonic() - started)
            results.append(_Result(knock=knock, outcome=outcome))
    return results


def _asked(case: ProtocolCase, trained: Mapping[str, Estimator]) -> dict[str, Callable[[], Answer]]:
    """The trained estimators, or else all others; these learn the case's reference once."""
    if trained:
        return {name: partial(estimator, case) for name, estimator in trained.items()}
    learned = learn_case(case)
    return {name: partial(estimator, learned) for name, estimator in UNTRAINED.items()}


def _write(output: Path, results: Sequence[_Result]) -> None:
    outcomes = [{"knock": r.knock, **asdict(r.outcome)} for r in results]
    write_results(output, outcomes=outcomes)
