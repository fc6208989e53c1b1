"""Plots of the protocol: drift found against true, the ground re-projected, errors over tracks."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from models.geometry.ground import ground_from_pixel, pixel_from_ground
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array
from studies.protocol.cases import Outcome, ProtocolCase, pose_of_plane_parameters

COLORS = ("#136", "#c60", "#482", "#919", "#888", "#b22", "#0aa", "#d7a", "#aa0")
_GRID_M = 5.0


def plot_drift(outcomes: Sequence[Outcome], path: Path) -> None:
    """Error over true drift: a panel for tilt, roll and height, a colour for each estimator."""
    pyplot = pyplot_of_files()
    figure, panels = pyplot.subplots(1, 3, figsize=(11, 3.4), constrained_layout=True)
    names = list(dict.fromkeys(outcome.estimator for outcome in outcomes))
    for number, (panel, label, scale) in enumerate(
        zip(panels, ("tilt, deg", "roll, deg", "height, %"), (1, 1, 100), strict=True)
    ):
        for name, color in zip(names, COLORS, strict=False):
            own = [o for o in outcomes if o.estimator == name and not o.degenerate]
            true = np.array([o.true_drift[number] for o in own]) * scale
            error = np.array([o.drift[number] - o.true_drift[number] for o in own]) * scale
            panel.plot(true, error, ".", color=color, alpha=0.6, label=name)
        panel.axhline(0, color="black", linewidth=0.7)
        panel.set(xlabel=f"true drift in {label}", ylabel="error")
        panel.grid(alpha=0.3)
    panels[0].legend(fontsize=7)
    figure.savefig(path, dpi=110)
    pyplot.close(figure)


def plot_ground(case: ProtocolCase, values: Array, path: Path) -> None:
    """A 5 m grid on the ground as the prior, the true and the estimated pose see it.

    Source: Xu et al. 2020, figure 5 (ground plane re-projected with true and estimated pose).
    """
    pyplot = pyplot_of_files()
    lens = case.intrinsics
    figure, panel = pyplot.subplots(figsize=(8, 8 * lens.height / lens.width))
    for trajectory in case.seen:
        panel.plot(*trajectory.uv.T, color="#bbb", linewidth=0.6)
    feet = np.concatenate([trajectory.uv for trajectory in case.seen])
    estimated = pose_of_plane_parameters(values, case.prior_pose)
    for pose, color, label in (
        (case.prior_pose, "#c60", "prior pose"),
        (case.true_pose, "black", "true pose"),
        (estimated, "#06c", "estimated pose"),
    ):
        for line in _grid(case, feet):
            uv, valid = pixel_from_ground(lens, pose.rotation, pose.centre_m, line)
            panel.plot(*np.where(valid[:, None], uv, np.nan).T, color=color, linewidth=0.9)
        panel.plot([], [], color=color, label=label)
    panel.set(xlim=(0, lens.width), ylim=(lens.height, 0), xlabel="u, px", ylabel="v, px")
    panel.set_title(f"{case.scene_id}, seed {case.seed}: a {_GRID_M:g} m grid on the ground")
    panel.legend(loc="upper right", fontsize=8)
    figure.savefig(path, dpi=110, bbox_inches="tight")
    pyplot.close(figure)


def plot_track_errors(curves: Mapping[str, Sequence[tuple[int, float, float]]], path: Path) -> None:
    """Angle error over the number of tracks for each scene, with the Cramer-Rao bound dashed.

    `curves` has (tracks, error, bound) in degrees, of all seeds together.
    """
    pyplot = pyplot_of_files()
    figure, panel = pyplot.subplots(figsize=(6, 4), constrained_layout=True)
    for (scene, points), color in zip(curves.items(), COLORS, strict=False):
        counts = sorted({count for count, _, _ in points})
        rms = [_rms([e for count, e, _ in points if count == n]) for n in counts]
        bound = [_rms([b for count, _, b in points if count == n]) for n in counts]
        panel.plot(counts, rms, "o-", color=color, label=scene, markersize=4)
        panel.plot(counts, bound, "--", color=color, linewidth=0.9)
    panel.set(xscale="log", yscale="log", xlabel="tracks after the knock")
    panel.set_ylabel("angle error, deg (root mean square)")
    panel.grid(alpha=0.3, which="both")
    panel.legend(fontsize=8, title="dashed: Cramer-Rao bound", title_fontsize=8)
    figure.savefig(path, dpi=110)
    pyplot.close(figure)


def _grid(case: ProtocolCase, feet: Array) -> list[Array]:
    """Lines (60, 2) on the ground around where people were seen, by the true pose."""
    pose: CameraPose = case.true_pose
    ground, valid = ground_from_pixel(case.intrinsics, pose.rotation, pose.centre_m, feet)
    low, high = (np.quantile(ground[valid], share, axis=0) for share in (0.02, 0.98))
    low, high = np.floor(low / _GRID_M) * _GRID_M, np.ceil(high / _GRID_M) * _GRID_M
    lines = []
    for axis in (0, 1):
        along = np.linspace(low[1 - axis], high[1 - axis], 60)
        for at in np.arange(low[axis], high[axis] + 0.1, _GRID_M):
            line = np.empty((60, 2))
            line[:, axis], line[:, 1 - axis] = at, along
            lines.append(line)
    return lines


def _rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def pyplot_of_files() -> Any:
    """Matplotlib's pyplot, drawing to files alone."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    return pyplot
