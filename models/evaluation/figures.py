"""Plots of evaluations."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from models.evaluation.averaged_run import AveragedRun


def plot_speed_sweep(runs: Sequence[AveragedRun], path: Path) -> None:
    """Height and angle error over training speed, a dot for each run and a line of the means.

    Source: the experiment of Xu et al. 2020, section 4.3.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    speeds = sorted({run.training_speed_mps for run in runs})
    figure, panels = pyplot.subplots(1, 2, figsize=(9, 3.2), constrained_layout=True)
    for panel, name, label in (
        (panels[0], "height_error_m", "height error, m"),
        (panels[1], "angle_error_deg", "angle error, deg"),
    ):
        for run in runs:
            panel.plot(run.training_speed_mps, getattr(run, name), "o", color="#8aa", markersize=4)
        means = [
            np.mean([getattr(run, name) for run in runs if run.training_speed_mps == speed])
            for speed in speeds
        ]
        panel.plot(speeds, means, color="#136")
        panel.set(xlabel="training speed, m/s", ylabel=label, ylim=(0, None))
        panel.grid(alpha=0.3)
    figure.suptitle(", ".join(sorted({f"{run.scene}, {run.recipe} recipe" for run in runs})))
    figure.savefig(path, dpi=110)
    pyplot.close(figure)
