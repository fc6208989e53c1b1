"""Processes of studies, a bar of what has ended, and JSON that grows."""

import json
import multiprocessing
import multiprocessing.connection
import os
import platform
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from multiprocessing.context import SpawnContext
from multiprocessing.managers import SyncManager
from pathlib import Path
from typing import Any, TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

Result = TypeVar("Result")
_TICK_S = 1.0


def spawning() -> SpawnContext:
    """Start method of processes: spawned, not forked, for torch's threads survive no fork."""
    return multiprocessing.get_context("spawn")


def process_pool(processes: int) -> ProcessPoolExecutor:
    """So many processes, a core each, which end when this one does, however it does."""
    return ProcessPoolExecutor(processes, mp_context=spawning(), initializer=_end_with_parent)


def shared_values() -> SyncManager:
    """Manager of values that processes share, in a process of its own, which ends with this one."""
    manager = SyncManager(ctx=spawning())
    manager.start(_end_with_parent)
    return manager


def _end_with_parent() -> None:
    """A task of hours would go on by itself where the study was killed."""
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def watch(sentinel: int = parent.sentinel) -> None:
        multiprocessing.connection.wait([sentinel])
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def as_they_end(
    pool: ProcessPoolExecutor,
    tasks: Sequence[Callable[[], Result]],
    on_tick: Callable[[], None] | None = None,
) -> Iterator[tuple[int, Result]]:
    """The number of each task and its result, as tasks end; `on_tick` is called each second."""
    numbers = {pool.submit(task): number for number, task in enumerate(tasks)}
    waiting = set(numbers)
    while waiting:
        timeout_s = None if on_tick is None else _TICK_S
        ended, waiting = wait(waiting, timeout_s, return_when=FIRST_COMPLETED)
        for done in ended:
            yield numbers[done], done.result()
        if on_tick is not None:
            on_tick()


def with_bar(
    pool: ProcessPoolExecutor,
    tasks: Sequence[Callable[[], Result]],
    console: Console,
    what: str = "cases",
    cases: Sequence[int] | None = None,
) -> Iterator[Result]:
    """The results as tasks end, under a bar; `cases` says how many are in each task, or one."""
    counts = cases or [1] * len(tasks)
    columns = TextColumn(what), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    with Progress(*columns, console=console) as bar:
        row = bar.add_task(what, total=sum(counts))
        for number, result in as_they_end(pool, tasks):
            yield result
            bar.advance(row, counts[number])


def write_results(output: Path, *, versions: dict[str, str] | None = None, **fields: Any) -> None:
    """Write what a study has found so far, and on what machine."""
    machine = {
        "processor": platform.processor() or platform.machine(),
        "cores": multiprocessing.cpu_count(),
        **(versions or {}),
    }
    output.write_text(json.dumps({"machine": machine, **fields}, indent=1))
