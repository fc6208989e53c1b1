"""`python -m studies creep-study`: cameras that creep, and that stand; tables and JSON."""

import json
import time
from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from models.errors import DegenerateGeometryError
from studies.alarms.slow_drift_years import NUMBERS, SlowDriftCase, SlowDriftPlan, slow_drift_cases
from studies.code_hash import code_hash
from studies.runs import process_pool, with_bar, write_results

_TABLE_WIDTH = 120


def run_slow_drift_study(
    *, sites: int, seed: int, plan: SlowDriftPlan, processes: int, output: Path
) -> None:
    """Let simulated cameras creep in each number at each rate, and stand; print, write JSON.

    The JSON grows as sites end; those that it has by the same plan and code are not run again.
    """
    console = Console(width=max(Console().width, _TABLE_WIDTH))
    started = time.monotonic()
    found = _kept(output, plan)
    known = {(case.site, case.seed) for case in found}
    tasks = [partial(_live, site, seed, plan) for site in range(sites) if (site, seed) not in known]
    without = 0
    with process_pool(processes) as pool:
        for cases in with_bar(pool, tasks, console, "sites"):
            without += not cases
            found = sorted(
                (*found, *cases), key=lambda one: (one.site, one.seed, one.number, one.rate_deg)
            )
            results = [asdict(each) for each in found]
            write_results(output, code=code_hash(), plan=asdict(plan), results=results)
    if found:
        console.print(slow_drift_table([case for case in found if not case.still]))
        console.print(_still_words([case for case in found if case.still]))
    if without:
        console.print(f"{without} sites see too few people for an anchor")
    console.print(f"{output} has every case; {time.monotonic() - started:.0f} s in all")


def slow_drift_table(cases: Sequence[SlowDriftCase]) -> Table:
    """Table of cameras' turns when their creep was detected, by number and rate."""
    table = Table(title="turned by so many deg when it was told: median, 90 %, worst; bar 1.5, 2.5")
    for name in ("deg a month", *NUMBERS):
        table.add_column(name, justify="right")
    for rate_deg in sorted({case.rate_deg for case in cases}):
        cells = []
        for number in NUMBERS:
            turned = [
                case.told_deg if case.told_deg is not None else np.inf
                for case in cases
                if (case.number, case.rate_deg) == (number, rate_deg)
            ]
            quantiles = (
                np.quantile(turned, [0.5, 0.9, 1.0], method="higher") if turned else np.zeros(0)
            )
            cells.append(", ".join(f"{each:.2f}" for each in quantiles) + f" (n {len(turned)})")
        table.add_row(f"{rate_deg:g}", *cells)
    return table


def _still_words(cases: Sequence[SlowDriftCase]) -> str:
    years = sum(case.days for case in cases) / 365.25
    alarms = sum(case.alarms for case in cases)
    alarmed = sum(case.alarms > 0 for case in cases)
    return (
        f"still: {alarms} alarms in {years:.1f} camera-years, at {alarmed} of {len(cases)} cameras"
    )


def _kept(output: Path, plan: SlowDriftPlan) -> list[SlowDriftCase]:
    if not output.exists():
        return []
    kept = json.loads(output.read_text())
    if (kept.get("code"), kept["plan"]) != (code_hash(), asdict(plan)):
        return []
    return [SlowDriftCase(**each) for each in kept["results"]]


def _live(site: int, seed: int, plan: SlowDriftPlan) -> list[SlowDriftCase]:
    try:
        return slow_drift_cases(site, seed, plan)
    except DegenerateGeometryError:
        return []
