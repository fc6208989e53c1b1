"""`python -m studies paper`: the paper's tables beside ours, part by part, in a folder."""

import time
from collections.abc import Iterator, MutableMapping, Sequence
from dataclasses import asdict
from difflib import get_close_matches
from fnmatch import fnmatch
from functools import partial
from itertools import chain
from pathlib import Path

import torch
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from models.errors import CalibrationError, ShapeError
from models.tracks.scenes import load_scene
from studies.pages import markers, write_between
from studies.paper.kept import code_of, is_begun, kept_results, write_manifest
from studies.paper.part import PAPERS_OWN, PaperCase, PaperResult
from studies.paper.parts import PARTS
from studies.paper.plots import plot_efficiency
from studies.runs import as_they_end, process_pool, shared_values

_COMMAND = "python -m studies paper --write"


def run_paper(
    scenes: Sequence[Path],
    *,
    parts: Sequence[str],
    most_seeds: int | None,
    only: Sequence[str] = (),
    processes: int,
    out: Path,
    page: Path | None = None,
) -> None:
    """Run what is not yet in the folder, and write a table for each part, and the manifest.

    Args:
        scenes: folders with `camera.json` and `tracks.csv`.
        parts: names of `PARTS`; all where there are none.
        most_seeds: cases with a seed of this or more are left for later; None leaves none.
        only: patterns of "<variant> on <scene>"; other cases are left for later. None leave none.
        processes: cases at once, a core each; with 0 none is run, and tables alone are written.
        out: of `<part>.jsonl` (a result a line, as they come), `<part>.md`, figures, and
            `manifest.json`.
        page: with markers to write the tables between, or None.

    Raises:
        ShapeError: there is no part of a name, no case that a pattern matches, or the page lacks
            the markers of a part.
    """
    console = Console()
    for name in parts:
        if name not in PARTS:
            raise ShapeError(f"parts: one of {', '.join(PARTS)} is needed, got {name!r}")
    chosen = [name for name in PARTS if name in parts or not parts]
    folders = {folder.name: folder for folder in scenes}
    for folder in scenes:
        load_scene(folder)  # a wrong path fails before the first hour of training, not after
    cases = {name: PARTS[name].cases(sorted(folders)) for name in chosen}
    _refuse_what_matches_nothing(only, list(chain.from_iterable(cases.values())))
    out.mkdir(parents=True, exist_ok=True)
    for name in chosen:
        meant = [
            case
            for case in cases[name]
            if (most_seeds is None or case.seed < most_seeds) and _meant(case, only)
        ]
        _run_part(name, meant, folders, processes, out, page, console)
    _draw_efficiency(out)
    write_manifest(out)
    console.print(f"{out}/manifest.json says by what, when and how long")


def _run_part(
    name: str,
    cases: Sequence[PaperCase],
    folders: dict[str, Path],
    processes: int,
    out: Path,
    page: Path | None,
    console: Console,
) -> None:
    part = PARTS[name]
    kept, results = kept_results(out, name, console)
    known = {each.case for each in results}
    if processes:
        left = [case for case in cases if case not in known]
        for found in _found(left, folders, processes, console):
            kept.add([asdict(found)])
            results.append(found)
    text = f"{part.says}\n\n{part.table(results)}" if results else f"{part.says}: nothing yet\n"
    (out / f"{name}.md").write_text(text)
    if page is not None:
        write_between(page, markers(name, _COMMAND), text)
    if part.plot is not None and results:
        part.plot(results, out / f"{name}.png")
    console.print(text, markup=False, soft_wrap=True)


def _found(
    cases: Sequence[PaperCase], folders: dict[str, Path], processes: int, console: Console
) -> Iterator[PaperResult]:
    """The results of cases as they come; what one fails with is printed, and others go on."""
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn()
    with (
        shared_values() as manager,
        process_pool(processes) as pool,
        Progress(*columns, TimeRemainingColumn(), console=console) as bar,
    ):
        shares: MutableMapping[int, float] = manager.dict()
        row = bar.add_task(cases[0].part if cases else "nothing to run", total=len(cases))
        ended = 0

        def show() -> None:
            bar.update(row, completed=ended + sum(shares.values()))

        calls = [
            partial(_run, case, folders[case.scene], shares, number)
            for number, case in enumerate(cases)
        ]
        for number, found in as_they_end(pool, calls, show):
            shares.pop(number, None)
            ended += 1
            if isinstance(found, str):
                console.print(f"[red]{escape(_name(cases[number]))}:[/] {escape(found)}")
            else:
                yield found


def _run(
    case: PaperCase, folder: Path, shares: MutableMapping[int, float], number: int
) -> PaperResult | str:
    """The result of a case, or what it failed with: others go on."""
    torch.set_num_threads(1)
    begun = last_shown = time.monotonic()

    def report(share: float) -> None:
        nonlocal last_shown
        if time.monotonic() - last_shown > 1:
            shares[number], last_shown = share, time.monotonic()

    try:
        figures = PARTS[case.part].run(case, folder, report)
    except CalibrationError as error:
        return str(error)
    return PaperResult(
        case=case, figures=figures, seconds=time.monotonic() - begun, code=code_of(case)
    )


def _refuse_what_matches_nothing(only: Sequence[str], cases: Sequence[PaperCase]) -> None:
    names = sorted({_row_name(case) for case in cases})
    for pattern in only:
        if not any(fnmatch(name, pattern) for name in names):
            near = get_close_matches(pattern, names, n=3, cutoff=0.0)
            raise ShapeError(f"only: no case matches {pattern!r}; near it: {', '.join(near)}")


def _meant(case: PaperCase, only: Sequence[str]) -> bool:
    return not only or any(fnmatch(_row_name(case), pattern) for pattern in only)


def _row_name(case: PaperCase) -> str:
    return f"{case.variant} on {case.scene}"


def _name(case: PaperCase) -> str:
    return f"{case.part}, {_row_name(case)}, seed {case.seed}"


def _draw_efficiency(out: Path) -> None:
    """Errors over training time, of whatever was trained for the paper's own scene."""
    kept = [kept_results(out, name)[1] for name in ("regressors", "posenet") if is_begun(out, name)]
    trained = [
        each
        for each in chain.from_iterable(kept)
        if "training_cpu_s" in each.figures and each.case.scene == PAPERS_OWN
    ]
    if trained:
        plot_efficiency(trained, out / "efficiency.png")
