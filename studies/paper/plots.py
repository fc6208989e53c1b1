"""The one style of the study's figures."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from studies.paper.part import Figures, PaperResult


def panels(columns: int, rows: int = 1) -> tuple[Any, Any]:
    """A figure of panels (rows, columns), those of a row beside one another."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    size = (4.5 * columns, 3.8 if rows == 1 else 2.5 * rows)
    figure, axes = pyplot.subplots(
        rows, columns, figsize=size, constrained_layout=True, squeeze=False
    )
    for each in axes.flat:
        each.grid(alpha=0.3)
    return figure, axes


def save_with_legend(figure: Any, labelled: Any, path: Path) -> None:
    """Write a figure with the names of what is in one of its panels below them all."""
    handles, names = labelled.get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=2, fontsize=7)
    figure.savefig(path, dpi=110)


def plot_efficiency(results: Sequence[PaperResult], path: Path) -> None:
    """Errors over seconds of training: the paper's figure of efficiency, of one scene's runs."""
    figure, ((left, right),) = panels(2)
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


def plot_speeds(swept: Mapping[tuple[str, str], Mapping[float, Figures]], path: Path) -> None:
    """Errors over the training speed in m/s, of each scene and recipe: the paper's figure.

    A row for each recipe, a line for each scene.
    """
    recipes = list(dict.fromkeys(recipe for _, recipe in swept))
    scenes = sorted({scene for scene, _ in swept})
    figure, rows = panels(2, len(recipes))
    for (scene, recipe), found in swept.items():
        for panel, name in zip(rows[recipes.index(recipe)], ("height_m", "deg"), strict=True):
            errors = [figures[name] for figures in found.values()]
            color = f"C{scenes.index(scene)}"
            panel.plot(list(found), errors, "-", color=color, marker=".", label=scene)
    fastest = max(speed for found in swept.values() for speed in found)
    for recipe, row in zip(recipes, rows, strict=True):
        for panel, label in zip(row, ("height off, m", "angle off, deg"), strict=True):
            panel.set(ylabel=label, xlim=(0, 1.03 * fastest), ylim=(0, None))
            panel.set_title(recipe, fontsize=9)
    for panel in rows[-1]:
        panel.set(xlabel="training speed, m/s")
    save_with_legend(figure, max(rows, key=lambda row: len(row[0].lines))[0], path)


def _kind(result: PaperResult) -> str:
    return "PoseNet, by alpha" if result.case.part == "posenet" else result.case.variant
