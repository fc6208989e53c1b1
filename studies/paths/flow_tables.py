"""`python -m studies flow-study`: the flow map on simulated sites, in parallel; tables and JSON."""

import time
from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from models.reasons import TracksCode
from studies.paths.flow_study import (
    REFERENCE_TRACKS,
    ChangedResult,
    SiteResults,
    study_site,
)
from studies.runs import process_pool, with_bar, write_results

_TABLE_WIDTH = 110


def run_flow_study(*, sites: int, seed: int, processes: int, output: Path) -> None:
    """Study simulated sites, print what was found, write JSON.

    The JSON grows as sites end, so an interrupted study keeps what it has.
    """
    console = Console(width=max(Console().width, _TABLE_WIDTH))
    started = time.monotonic()
    found: list[SiteResults] = []
    tasks = [partial(study_site, site, seed) for site in range(sites)]
    with process_pool(processes) as pool:
        for result in with_bar(pool, tasks, console, "sites"):
            found.append(result)
            found.sort(key=lambda results: results.site)
            _write(output, seed, found)
    console.print(knocked_table(found))
    console.print(changed_table(found))
    simulated, learned, estimated = (
        float(np.median([getattr(results, name) for results in found]))
        for name in ("simulated_s", "learned_s", "estimated_s")
    )
    console.print(
        f"a site: {simulated:.1f} s simulated, {learned:.1f} s learned, {estimated:.1f} s "
        f"estimated (medians); {output} has all; {time.monotonic() - started:.0f} s"
    )


def knocked_table(found: Sequence[SiteResults]) -> Table:
    """Errors after a knock, by the number of tracks, and how often intervals hold the truth."""
    table = Table(
        title=f"knocked: {len(found)} sites, {REFERENCE_TRACKS} reference tracks; "
        "median errors (90th percentiles), share that the 90 % interval covers",
        title_justify="left",
    )
    for name in ("tracks", "tilt, deg", "roll, deg", "pan, deg", "height, %"):
        table.add_column(name, justify="right", no_wrap=True)
    for number in range(len(found[0].knocked)):
        own = [results.knocked[number] for results in found]
        errors = np.abs([result.errors for result in own]) * [1, 1, 1, 100]
        covered = np.mean([result.covered for result in own], axis=0)
        cells = [
            f"{np.median(error):.2f} ({np.quantile(error, 0.9):.2f}) {share:.0%}"
            for error, share in zip(errors.T, covered, strict=True)
        ]
        table.add_row(str(own[0].tracks), *cells)
    return table


def changed_table(found: Sequence[SiteResults]) -> Table:
    """Table of a still camera's drift when half of the people take a new path."""
    table = Table(
        title="still, half on a new path: median angles (90th percentile; largest), deg",
        title_justify="left",
    )
    for name in (
        "tracks", "off the truth", "off the pose\nby old paths", "by old paths,\noff the truth",
        "beyond\n1 deg", "all four\ncovered", "paths\nnamed",
    ):  # fmt: skip
        table.add_column(name, justify="right", no_wrap=True)
    for number in range(len(found[0].changed)):
        own = [results.changed[number] for results in found]
        angles = [
            _spread([getattr(result, name) for result in own])
            for name in ("off_truth_deg", "off_unchanged_deg", "unchanged_off_truth_deg")
        ]
        shares = (
            float(np.mean([result.off_truth_deg > 1 for result in own])),
            float(np.mean([all(result.covered) for result in own])),
            float(np.mean([_blames_paths(result) for result in own])),
        )
        table.add_row(str(own[0].tracks), *angles, *(f"{share:.0%}" for share in shares))
    return table


def _blames_paths(result: ChangedResult) -> bool:
    return result.reason is not None and result.reason.code is TracksCode.PATHS_CHANGED


def _spread(values: Sequence[float]) -> str:
    return f"{np.median(values):.2f} ({np.quantile(values, 0.9):.2f}; {max(values):.2f})"


def _write(output: Path, seed: int, found: Sequence[SiteResults]) -> None:
    sites = [asdict(results) for results in found]
    write_results(output, seed=seed, reference_tracks=REFERENCE_TRACKS, sites=sites)
