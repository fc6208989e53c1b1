"""`parts`: the protocol's figures with each part of the estimator off, and what a part costs."""

import time
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import nullcontext
from dataclasses import asdict, dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path

from rich.console import Console

from models.errors import ShapeError
from studies.lines_file import LinesFile
from studies.pages import markers, write_between
from studies.runs import with_bar
from studies.served.figures import figures_of
from studies.served.outcomes import ServedOutcome
from studies.served.parts_catalogue import PARTS
from studies.served.run import served_plan
from studies.served.tasks import Table, tasks_of, work

BETWEEN = markers("parts", "python -m studies parts --write")
WHOLE = "nothing"
_BATCH = 50  # tracks that come at once
_TABLES = (Table.FEW, Table.FAR, Table.MIDWAY)


@dataclass(frozen=True, slots=True, kw_only=True)
class PartFigures:
    """Figures of cases with a part off: degrees, shares.

    `fault` is a fault, a table of other cases (few tracks, far pans), or empty: cases by time.
    `covered` is the share of identifiable parameters whose 90 % interval holds the truth, `beyond`
    the cases with one more than 5 standard deviations off, `told` the share of those that moved
    of which that is said, `false_alarms` the number of those that stood of which it is, `cpu_s`
    seconds a case.
    """

    part: str
    fault: str
    cases: int
    still_deg: float | None
    moved_deg: float
    moved_p90_deg: float
    height_error: float
    covered: float
    beyond: int
    cut: float
    told: float
    cpu_s: float
    false_alarms: int | None = None


def run_parts(
    folders: Sequence[Path],
    *,
    seeds: int,
    processes: int,
    output: Path,
    page: Path | None,
    only: Sequence[str] = (),
) -> None:
    """Measure what the output does not have yet, print the table, write it into a page.

    Of all parts, or of `only` some, each beside all of them together.

    Raises:
        ShapeError: a recording or the output cannot be read, the page lacks its markers, or there
            is no such part.
    """
    for name in only:
        if name not in PARTS:
            raise ShapeError(f"part: {', '.join(PARTS)} are known, got {name!r}")
    console, kept = Console(), LinesFile(output)
    found = [PartFigures(**row) for row in kept.rows]
    known = {(each.part, each.fault) for each in found}
    wanted = [
        (part, fault)
        for part, fault in wanted_rows(only or tuple(PARTS))
        if (part, fault) not in known
    ]
    pool = ProcessPoolExecutor(processes, mp_context=get_context("spawn"), max_tasks_per_child=1)
    calls = [partial(measure, part, fault, list(folders), seeds) for part, fault in wanted]
    with pool:
        for figures in with_bar(pool, calls, console):
            kept.add([asdict(figures)])
            found.append(figures)
    text = table_of(found)
    console.print(text, markup=False, highlight=False, soft_wrap=True)
    if page is not None:
        write_between(page, BETWEEN, text)


def measure(part: str, fault: str, folders: Sequence[Path], seeds: int) -> PartFigures:
    """The figures of all cases with a part off, or with all of them."""
    table = Table(fault) if fault in _TABLES else Table.FAULTS if fault else Table.TIME
    tasks = tasks_of(
        folders,
        tables=[table],
        seeds=range(seeds),
        batch=_BATCH,
        faults=[fault] if table == Table.FAULTS else [],
    )
    plan = served_plan(_BATCH)
    begun_s, rows = time.process_time(), []
    with nullcontext() if part == WHOLE else PARTS[part].switched_off():
        for task in tasks:
            # Of faults not those without any.
            if table != Table.FAULTS or all(case.fault == fault for case in task.case_ids):
                rows += work(task, plan)
    served = [row for row in rows if isinstance(row.outcome, ServedOutcome)]
    outcomes = [row.outcome for row in served if isinstance(row.outcome, ServedOutcome)]
    pairs = list(zip(served, outcomes, strict=True))
    stood = [o for r, o in pairs if _stands(r.case_id.knock)]
    turned = [o for r, o in pairs if not _stands(r.case_id.knock)]
    moved = figures_of(turned)
    every = figures_of(outcomes)
    own = [n for outcome in outcomes for n in outcome.parameters if n.identifiable]
    return PartFigures(
        part=part,
        fault=fault,
        cases=len(outcomes),
        still_deg=figures_of(stood).rotation_deg if stood else None,
        moved_deg=moved.rotation_deg,
        moved_p90_deg=moved.rotation_p90_deg,
        height_error=moved.height_error,
        covered=sum(n.covered for n in own) / max(len(own), 1),
        beyond=every.beyond,
        cut=every.cut,
        told=sum(o.state == "drifting" for o in turned) / max(len(turned), 1),
        cpu_s=(time.process_time() - begun_s) / max(len(outcomes), 1),
        false_alarms=sum(o.state == "drifting" for o in stood),
    )


def table_of(found: Iterable[PartFigures]) -> str:
    """The table in Markdown: all parts on, then each off, what it is there for first."""
    by_key = {(each.part, each.fault): each for each in found}
    head = (
        "off", "with", "n", "still, deg", "moved, deg (worst tenth)", "height", "covered",
        "beyond 5 sd", "cut", "told", "false", "CPU-s a case", "lines",
    )  # fmt: skip
    rows = [head, ("---",) * len(head)]
    for part, fault in wanted_rows(tuple(PARTS)):
        each = by_key.get((part, fault))
        if each is not None:
            rows.append(_row(each))
    return "\n".join("| " + " | ".join(map(str, row)) + " |" for row in rows) + "\n"


def _row(each: PartFigures) -> tuple[str, ...]:
    part = PARTS.get(each.part)
    return (
        each.part if part is None else f"{each.part}: {part.words}",
        each.fault or "nothing wrong",
        str(each.cases),
        "-" if each.still_deg is None else f"{each.still_deg:.2f}",
        f"{each.moved_deg:.2f} ({each.moved_p90_deg:.1f})",
        f"{each.height_error:.1%}",
        f"{each.covered:.0%}",
        str(each.beyond),
        f"{each.cut:.0%}",
        f"{each.told:.0%}",
        "" if each.false_alarms is None else str(each.false_alarms),
        f"{each.cpu_s:.2f}",
        "" if part is None else str(part.lines),
    )


def wanted_rows(names: Sequence[str]) -> list[tuple[str, str]]:
    """Each of some parts with the faults it is there for, beside all parts with these."""
    parts = {name: PARTS[name] for name in names}
    faults = dict.fromkeys(fault for part in parts.values() for fault in part.faults)
    whole = [(WHOLE, fault) for fault in ("", *faults)]
    return whole + [(name, fault) for name, part in parts.items() for fault in ("", *part.faults)]


def _stands(knock: str) -> bool:
    return knock == "still"
