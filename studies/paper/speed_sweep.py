"""Plots of evaluations."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from studies.paper.centred_run import AveragedRun


def plot_speed_sweep(runs: Sequence[AveragedRun], path: Path) -> None:
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
