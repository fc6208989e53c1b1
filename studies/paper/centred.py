"""`centred`: offline, the averaged estimate on recorded scenes, as a table and JSON."""

from collections.abc import MutableMapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from itertools import product
from pathlib import Path
from statistics import mean

import numpy as np
import torch
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from models.regression.recipe import TrainingProgress
from models.tracks.scenes import load_scene
from studies.paper.centred_run import AveragedRun, run_averaged
from studies.runs import as_they_end, process_pool, shared_values, write_results


@dataclass(frozen=True, slots=True, kw_only=True)
class _Task:
    """One training to evaluate."""

    folder: Path
    recipe: str
    seed: int
    speed_mps: float
    epochs: int | None


def run_centred(
    folders: Sequence[Path],
    *,
    recipe: str,
    seeds: Sequence[int],
    speeds_mps: Sequence[float],
    epochs: int | None,
    processes: int,
    output: Path,
    plot: Path | None,
) -> None:
    """Train and average for each scene, training speed and seed; print, and write JSON.

    The JSON grows as runs end, so an interrupted evaluation keeps what it has.
    """
    console = Console()
    tasks = [
        _Task(folder=folder, recipe=recipe, seed=seed, speed_mps=speed, epochs=epochs)
        for folder, speed, seed in product(folders, speeds_mps, seeds)
    ]
    for folder in folders:
        load_scene(folder)  # a wrong path fails before the first hour of training, not after
    runs: list[AveragedRun] = []
    with (
        shared_values() as manager,
        process_pool(processes) as pool,
        Progress(console=console) as bar,
    ):
        steps: MutableMapping[int, tuple[int, int]] = manager.dict()
        rows = [bar.add_task(_name(task), total=None) for task in tasks]
        under_way = set(range(len(tasks)))

        def show_steps() -> None:
            for number in under_way:
                if number in steps:
                    bar.update(rows[number], completed=steps[number][0], total=steps[number][1])

        calls = [partial(_run, task, steps, number) for number, task in enumerate(tasks)]
        for number, run in as_they_end(pool, calls, show_steps):
            under_way.discard(number)
            runs.append(run)
            _write(output, runs)
            bar.update(rows[number], total=1, completed=1)
    runs.sort(key=lambda run: (run.scene, run.training_speed_mps, run.seed))
    _write(output, runs)
    console.print(_table(runs))
    console.print(f"{output} has the figures")
    if plot is not None:
        _plot_speed_sweep(runs, plot)
        console.print(f"{plot} has the plot")


def _run(task: _Task, steps: MutableMapping[int, tuple[int, int]], number: int) -> AveragedRun:
    torch.set_num_threads(1)

    def report(progress: TrainingProgress) -> None:
        if progress.step % 10 == 0:
            steps[number] = (progress.step, progress.steps)

    return run_averaged(
        load_scene(task.folder),
        recipe_name=task.recipe,
        seed=task.seed,
        training_speed_mps=task.speed_mps,
        epochs=task.epochs,
        on_progress=report,
    )


def _name(task: _Task) -> str:
    return f"{task.folder.name} {task.recipe} {task.speed_mps:g} m/s seed {task.seed}"


def _write(output: Path, runs: Sequence[AveragedRun]) -> None:
    versions = {"torch": str(torch.__version__)}
    write_results(output, versions=versions, runs=[asdict(run) for run in runs])


def _table(runs: Sequence[AveragedRun]) -> Table:
    recipes = ", ".join(sorted({run.recipe for run in runs}))
    table = Table(title=f"averaged estimate, {recipes} recipe, trained around the true pose")
    table.add_column("scene", no_wrap=True)
    for column in ("m/s", "seed", "tracks", "height m", "off m", "off deg", "training s"):
        table.add_column(column, justify="right")
    groups: dict[tuple[str, float], list[AveragedRun]] = {}
    for run in runs:
        groups.setdefault((run.scene, run.training_speed_mps), []).append(run)
    for (scene, speed), group in groups.items():
        for run in group:
            table.add_row(scene, f"{speed:g}", str(run.seed), str(run.tracks), *_figures([run]))
        if len(group) > 1:
            table.add_row(scene, f"{speed:g}", "mean", "", *_figures(group), style="bold")
    return table


def _figures(runs: Sequence[AveragedRun]) -> list[str]:
    return [
        f"{mean(run.height_m for run in runs):.2f}",
        f"{mean(run.height_error_m for run in runs):.2f}",
        f"{mean(run.angle_error_deg for run in runs):.2f}",
        f"{mean(run.training_s for run in runs):.0f}",
    ]


def _plot_speed_sweep(runs: Sequence[AveragedRun], path: Path) -> None:
    """Height and angle error over training speed: a dot a run, a line a recipe through the means.

    Source: the experiment of Xu et al. 2020, section 4.3.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, panels = pyplot.subplots(1, 2, figsize=(9, 3.2), constrained_layout=True)
    recipes = sorted({run.recipe for run in runs})
    for panel, name, label in (
        (panels[0], "height_error_m", "height error, m"),
        (panels[1], "angle_error_deg", "angle error, deg"),
    ):
        for recipe, color in zip(recipes, ("#136", "#c60"), strict=False):
            own = [run for run in runs if run.recipe == recipe]
            speeds = sorted({run.training_speed_mps for run in own})
            means = [
                np.mean([getattr(run, name) for run in own if run.training_speed_mps == speed])
                for speed in speeds
            ]
            dots = [(run.training_speed_mps, getattr(run, name)) for run in own]
            panel.plot(*np.array(dots).T, "o", color=color, alpha=0.5, markersize=4)
            panel.plot(speeds, means, color=color, label=f"{recipe} recipe")
        panel.set(xlabel="training speed, m/s", ylabel=label, ylim=(0, None))
        panel.grid(alpha=0.3)
    panels[0].legend()
    figure.suptitle(", ".join(sorted({run.scene for run in runs})))
    figure.savefig(path, dpi=110)
    pyplot.close(figure)
