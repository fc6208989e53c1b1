"""`protocol`: what is served, by time, by faults, in long replays; stored as it comes."""

import signal
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from rich.console import Console

from models.errors import CalibrationError
from service.references import drift_limits
from service.settings import Settings
from studies.pages import write_between
from studies.runs import process_pool, with_bar
from studies.served.outcome_file import OutcomeFile
from studies.served.replays import ReplayPlan
from studies.served.tables import BETWEEN, all_tables
from studies.served.tasks import CaseResult, Table, Task, tasks_of, work
from studies.served.windows import Window


def run_served(
    folders: Sequence[Path],
    *,
    tables: Sequence[Table],
    seeds: Sequence[int],
    faults: Sequence[str],
    batch: int,
    processes: int,
    output: Path,
    page: Path | None,
) -> None:
    """Work out what is not in the output yet, print its tables, write them into a page.

    Ended by Ctrl-C or SIGTERM, it keeps what has come; started again, it goes on.

    Raises:
        ShapeError: a recording or the output cannot be read, or the page lacks its markers.
        CalibrationError: some cases failed in a way that nobody foresaw; all others are stored.
    """
    console = Console()
    kept = OutcomeFile(output)
    started = time.monotonic()
    tasks = _left(tasks_of(folders, tables=tables, seeds=seeds, batch=batch, faults=faults), kept)
    plan = served_plan(batch)
    failures: list[CaseResult] = []
    if tasks:
        failures = _work_off(tasks, plan, processes, kept, console)
    text = all_tables(kept.heading, kept.found.values())
    console.print(text, markup=False, highlight=False, soft_wrap=True)
    if page is not None:
        write_between(page, BETWEEN, text)
    console.print(f"{output} has all; {time.monotonic() - started:.0f} s")
    if failures:
        first = failures[0]
        raise CalibrationError(
            f"{len(failures)} failed; the first, {first.case_id}: {first.failure}"
        )


def served_plan(batch: int) -> ReplayPlan:
    """The windows and limits of the service's settings, tracks coming so many at once."""
    settings = Settings()
    return ReplayPlan(
        window=Window(
            tracks=settings.window_tracks, days=settings.window_days, batch=batch or None
        ),
        limits=drift_limits(settings),
        alarms_a_year=settings.false_alarms_per_year,
    )


def _left(tasks: Sequence[Task], kept: OutcomeFile) -> list[Task]:
    """Tasks that are not in the output yet."""
    found = []
    for task in tasks:
        case_ids = tuple(each for each in task.case_ids if each not in kept.found)
        if case_ids:
            found.append(Task(folder=task.folder, camera=task.camera, case_ids=case_ids))
    return found


def _work_off(
    tasks: Sequence[Task], plan: ReplayPlan, processes: int, kept: OutcomeFile, console: Console
) -> list[CaseResult]:
    """Store outcomes as tasks end; returns those that failed."""
    failures: list[CaseResult] = []
    calls = [partial(work, task, plan) for task in tasks]
    pool = process_pool(processes)
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)  # as Ctrl-C
    try:
        cases = [len(task.case_ids) for task in tasks]
        for found in with_bar(pool, calls, console, cases=cases):
            kept.add(found)
            failures += [each for each in found if each.failure]
    except KeyboardInterrupt:
        console.print(f"ended; {kept.path} has {len(kept.found)}, and the same command goes on")
        raise
    finally:
        pool.shutdown(cancel_futures=True)
        signal.signal(signal.SIGTERM, before)
    return failures
