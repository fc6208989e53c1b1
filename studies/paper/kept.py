"""Kept results of `paper`: of each part, of which code, and a manifest of them all."""

import platform
from collections.abc import Sequence
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from statistics import fmean
from typing import Any

from rich.console import Console

from studies.code_hash import code_hash
from studies.lines_file import LinesFile
from studies.paper.part import PaperCase, PaperResult
from studies.paper.parts import PARTS
from studies.runs import write_results

_VERSIONS = ("numpy", "scipy", "opencv-python-headless", "torch", "surefoot")


def code_of(case: PaperCase) -> str:
    """The hash of the code that makes a case's figures."""
    return code_hash(PARTS[case.part].made_by(case))


def kept_results(
    out: Path, name: str, console: Console | None = None
) -> tuple[LinesFile, list[PaperResult]]:
    """The file of a part's results, and those in it that today's code has made."""
    file = LinesFile(out / f"{name}.jsonl", rows_tell_code=True)
    found = results_of(file.rows)
    results = [each for each in found if each.code == code_of(each.case)]
    if console is not None and len(results) < len(found):
        console.print(f"{name}: {len(found) - len(results)} results of other code are left out")
    return file, results


def results_of(rows: Sequence[dict[str, Any]]) -> list[PaperResult]:
    """The results of a part's rows, as they were kept."""
    return [PaperResult(**{**row, "case": PaperCase(**row["case"])}) for row in rows]


def is_begun(out: Path, name: str) -> bool:
    """True where a folder has results of a part."""
    return (out / f"{name}.jsonl").exists()


def write_manifest(out: Path) -> None:
    """Write code, machine and time of each part that the folder has."""
    parts = {}
    for name in PARTS:
        if not is_begun(out, name):
            continue
        kept, results = kept_results(out, name)
        parts[name] = {
            "heading": asdict(kept.heading),
            "cases": len(results),
            "seeds": sorted({each.case.seed for each in results}),
            "scenes": sorted({each.case.scene for each in results}),
            "seconds": sum(each.seconds for each in results),
            "seconds_a_case": fmean(each.seconds for each in results) if results else None,
        }
    versions = {name: version(name) for name in _VERSIONS} | {"python": platform.python_version()}
    write_results(out / "manifest.json", versions=versions, parts=parts)
