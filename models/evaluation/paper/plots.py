"""The one style of the study's figures."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from models.evaluation.paper.part import PaperResult


def panels(count: int) -> tuple[Any, Sequence[Any]]:
    """A figure of some panels beside one another."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, count, figsize=(4.5 * count, 3.8), constrained_layout=True)
    for each in axes:
        each.grid(alpha=0.3)
    return figure, axes


def save_with_legend(figure: Any, labelled: Any, path: Path) -> None:
    """Write a figure with the names of what is in one of its panels below them all."""
    handles, names = labelled.get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=2, fontsize=7)
    figure.savefig(path, dpi=110)


def plot_efficiency(results: Sequence[PaperResult], path: Path) -> None:
    """Errors over seconds of training: the paper's figure of efficiency, of one scene's runs."""
    figure, (left, right) = panels(2)
    kinds = sorted({_kind(each) for each in results})
    for number, kind in enumerate(kinds):
        own = [each.figures for each in results if _kind(each) == kind]
        seconds = [each["training_cpu_s"] for each in own]
        for panel, name in ((left, "centred_height_m"), (right, "centred_deg")):
            panel.plot(
                seconds, [each[name] for each in own], "o", color=f"C{number}", label=kind, ms=4
            )
    for panel, label in ((left, "height off, m"), (right, "angle off, deg")):
        panel.set(xlabel="training, CPU-s", ylabel=label, xscale="log", ylim=(0, None))
    save_with_legend(figure, left, path)


def _kind(result: PaperResult) -> str:
    return "PoseNet, by alpha" if result.case.part == "posenet" else result.case.variant
