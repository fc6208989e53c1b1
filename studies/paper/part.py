"""A part of the study of the paper: its cases, how one is run, and the table that they make."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

Figures = dict[str, float]
OnShare = Callable[[float], None]

# What a regressor's figures are made by, and those of what is served.
TRAINED = (
    "models.regression.training",
    "models.regression.network",
    "models.regression.averaging",
    "models.simulation.poses",
)
SERVED_BY = ("studies.protocol.flow_runs", "studies.protocol.learned")
PAPERS_OWN = "town_centre"  # of the paper's scenes the one that can be had

_MADE_UP = "wildtrack"  # boxes there are projected cylinders of one size


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperCase:
    """Unit of a run: a variant of a part's method on a scene, with a seed."""

    part: str
    scene: str
    variant: str
    seed: int


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperResult:
    """The figures of a case by name, how long it took, and the hash of the code that made them."""

    case: PaperCase
    figures: Figures
    seconds: float
    code: str


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperPart:
    """One table or figure of the paper, beside ours.

    `cases` names the cases of some scenes; `run` answers one from its scene's folder and is told
    whom to tell which share is done; `made_by` names the modules whose code makes a case's figures;
    `table` is Markdown of the results that there are, and `plot` draws them into a PNG.
    """

    says: str
    cases: Callable[[Sequence[str]], list[PaperCase]]
    run: Callable[[PaperCase, Path, OnShare], Figures]
    made_by: Callable[[PaperCase], tuple[str, ...]]
    table: Callable[[Sequence[PaperResult]], str]
    plot: Callable[[Sequence[PaperResult], Path], None] | None = None


def own_first(scenes: Sequence[str]) -> list[str]:
    """The scenes, the paper's own before others."""
    return sorted(scenes, key=lambda scene: scene != PAPERS_OWN)


def with_boxes(scenes: Sequence[str]) -> list[str]:
    """The scenes that have boxes of people."""
    return [scene for scene in scenes if not scene.startswith(_MADE_UP)]


def by_row(results: Sequence[PaperResult]) -> dict[tuple[str, str], list[Figures]]:
    """The figures of each scene and variant, one for each seed, in the order of their names."""
    rows: dict[tuple[str, str], list[Figures]] = {}
    for each in sorted(results, key=lambda one: (one.case.scene, one.case.variant, one.case.seed)):
        rows.setdefault((each.case.scene, each.case.variant), []).append(each.figures)
    return rows


def markdown(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table of Markdown."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"
