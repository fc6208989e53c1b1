"""`alarm-study` and the alarms of `evaluate`: in parallel; tables and JSON."""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

from rich.console import Console

from models.errors import DegenerateGeometryError
from models.tracks.scenes import load_scene
from service.references import drift_limits
from service.settings import Settings
from studies.alarms.camera_years import live_year
from studies.alarms.results import AlarmResults
from studies.alarms.scene_alarms import judge_scene
from studies.alarms.tables import BARS, delay_table, still_table
from studies.runs import process_pool, with_bar, write_results

_TABLE_WIDTH = 130


@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmPlan:
    """Plan of a study of alarms: false alarms a year, traffic, and for how long."""

    alarms_a_year: float
    tracks_a_day: float
    reference_tracks: int
    days: int


def run_alarm_study(
    *, sites: int, seed: int, plan: AlarmPlan, processes: int, output: Path
) -> None:
    """Let simulated cameras live for a while and be knocked; print tables, write JSON.

    The JSON grows as sites end, so an interrupted study keeps what it has.
    """
    tasks = [partial(_live, site, seed, plan) for site in range(sites)]
    _run(tasks, plan, processes, output, f"{sites} simulated sites")


def run_scene_alarms(
    folders: Sequence[Path], *, seeds: int, plan: AlarmPlan, processes: int, output: Path
) -> None:
    """False alarms and delays on recorded scenes, by the protocol's halves.

    Raises:
        ShapeError: a scene cannot be read.
    """
    tasks = [partial(_judge, folder, seed, plan) for folder in folders for seed in range(seeds)]
    _run(tasks, plan, processes, output, f"recorded scenes, {seeds} seeds")


def _run(
    tasks: Sequence[Callable[[], AlarmResults | None]],
    plan: AlarmPlan,
    processes: int,
    output: Path,
    what: str,
) -> None:
    console = Console(width=max(Console().width, _TABLE_WIDTH))
    started = time.monotonic()
    found: list[AlarmResults] = []
    without = 0
    with process_pool(processes) as pool:
        for result in with_bar(pool, tasks, console):
            if result is None:
                without += 1
                continue
            found.append(result)
            found.sort(key=lambda one: (one.name, one.seed))
            _write(output, plan, found)
    if found:
        set_to = f"{plan.alarms_a_year:g} false alarms a camera-year are set"
        console.print(still_table(f"still: {what}; {set_to}", found))
        console.print(delay_table("share of alarms within so many tracks, median tracks", found))
    if without:
        console.print(f"{without} of {len(tasks)} cases have no chart: too few walking groups")
    console.print(f"{output} has every case; {time.monotonic() - started:.0f} s in all")


def _live(site: int, seed: int, plan: AlarmPlan) -> AlarmResults | None:
    try:
        return live_year(
            site,
            seed,
            alarms_a_year=plan.alarms_a_year,
            tracks_a_day=plan.tracks_a_day,
            reference_tracks=plan.reference_tracks,
            days=plan.days,
            angles_deg=tuple(BARS),
        )
    except DegenerateGeometryError:
        return None


def _judge(folder: Path, seed: int, plan: AlarmPlan) -> AlarmResults | None:
    return judge_scene(
        load_scene(folder),
        seed,
        alarms_a_year=plan.alarms_a_year,
        tracks_a_day=plan.tracks_a_day,
        years=plan.days / 365.25,
        angles_deg=tuple(BARS),
        limits=drift_limits(Settings()),
    )


def _write(output: Path, plan: AlarmPlan, results: Sequence[AlarmResults]) -> None:
    found = [_never_as_null(asdict(result)) for result in results]
    write_results(output, plan=asdict(plan), results=found)


def _never_as_null(value: Any) -> Any:
    """A value as JSON can hold it, which has no infinity."""
    if isinstance(value, dict):
        return {name: _never_as_null(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [_never_as_null(each) for each in value]
    return None if isinstance(value, float) and math.isinf(value) else value
