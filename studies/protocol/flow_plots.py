"""Plots of the flow map: where people walk, with new tracks laid on it, and errors over tracks."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from models.geometry.ground import ground_from_pixel
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array, Mask
from models.paths.config import DIRECTIONS
from models.paths.density_map import PathDensityMap
from studies.protocol.flow_curves import CurvePoint
from studies.protocol.learned import Learned
from studies.protocol.plots import COLORS, pyplot_of_files

_FARTHEST_M = 150.0
_PANEL_IN = 6.0  # the longer side of a panel
_DECADES = 2.0  # of the density, below its highest
_ARROW_EVERY_M = 2.0
_ARROW_M = 2.2  # long where all go the same way
_CLEAR = 0.35  # of one: how far all go the same way
_AROUND_M = 3.0
_TICKS_TRACKS = [10, 20, 40, 80, 160, 320]
_TICKS_DEG = [0.25, 0.5, 1, 2, 4, 8]
_EDGE = 400  # points along each side of the picture


def plot_flow(learned: Learned, poses: Mapping[str, CameraPose], path: Path) -> None:
    """The flow map from above, a panel for each pose that lays the new tracks on the ground.

    Colours are how often people are at a place. Where it is clear which way they walk there is an
    arrow, or, where about as many come as go, a line.
    The camera is a triangle, its view's edge on the ground is dashed. Axes are the world's.
    """
    assert learned.site.paths is not None
    flow = learned.site.paths.density
    pyplot = pyplot_of_files()
    count = len(poses)
    low, high = _window(flow)
    width, height = _PANEL_IN * (high - low) / (high - low).max()
    figure, panels = pyplot.subplots(
        1,
        count,
        figsize=(max(width, _PANEL_IN / 2) * count + 1.6, height + 1.2),
        constrained_layout=True,
        sharex=True,
        sharey=True,
    )
    image = None
    for panel, (name, pose) in zip(panels, poses.items(), strict=True):
        image = _draw_map(panel, flow)
        for number, trajectory in enumerate(learned.case.seen):
            feet = _on_ground(learned, pose, trajectory.uv)
            label = "new tracks" if number == 0 else None
            panel.plot(*feet.T, color="#06c", linewidth=0.7, alpha=0.7, label=label)
        _draw_view(panel, learned, pose)
        panel.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
        panel.set(title=name, xlabel="world x from the camera, m")
    panels[0].set_ylabel("world y from the camera, m")
    key = {"color": "black", "marker": r"$\rightarrow$", "markersize": 14, "linestyle": "none"}
    panels[0].plot([], [], label="most walk this way; line: both ways", **key)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    bar = figure.colorbar(image, ax=list(panels), shrink=0.8)
    ticks = np.arange(-_DECADES, 0.1, 1.0)
    bar.set_ticks(ticks, labels=[f"{10**tick:g}" for tick in ticks])
    bar.set_label("reference: people at a place, of the most anywhere")
    figure.suptitle(
        f"{learned.case.scene_id}, seed {learned.case.seed}: where people walked before the knock"
    )
    figure.savefig(path, dpi=110)
    pyplot.close(figure)


def plot_flow_errors(curves: Mapping[str, Sequence[CurvePoint]], path: Path) -> None:
    """The fused pose's whole angle error over reference tracks, and over new tracks.

    Medians over seeds, a line a scene; the last point of a line has all tracks of the scene.
    """
    pyplot = pyplot_of_files()
    figure, panels = pyplot.subplots(
        1, 2, figsize=(11, 4.2), constrained_layout=True, sharey=True
    )  # fmt: skip
    for panel, varied, label in (
        (panels[0], "reference", "reference tracks (all new tracks)"),
        (panels[1], "seen", "new tracks (all reference tracks)"),
    ):
        for (scene, points), color in zip(curves.items(), COLORS, strict=False):
            line = curve_of([point for point in points if point.varied == varied])
            panel.plot(*line.T, "o-", color=color, label=scene, markersize=4)
        panel.set(xscale="log", yscale="log", xlabel=label)
        panel.set_xticks(_TICKS_TRACKS, labels=[str(tick) for tick in _TICKS_TRACKS], minor=False)
        panel.set_yticks(_TICKS_DEG, labels=[f"{tick:g}" for tick in _TICKS_DEG])
        panel.minorticks_off()
        panel.grid(alpha=0.3)
    panels[0].set_ylabel("whole angle off, deg (median over seeds)")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside right upper", fontsize=8)
    figure.suptitle("Fused pose after a knock of up to 8 deg in tilt, roll and pan, 15 % in height")
    figure.savefig(path, dpi=110)
    pyplot.close(figure)


def curve_of(points: Sequence[CurvePoint]) -> Array:
    """Tracks and median errors (N, 2) of one scene, by rising number of tracks.

    Numbers that some seeds did not have are left out: a median over others is of other knocks.
    """
    groups: dict[int | None, list[CurvePoint]] = {}
    for point in points:
        groups.setdefault(point.asked, []).append(point)
    most = max(map(len, groups.values()), default=0)
    rows = [
        (
            float(np.median([point.tracks for point in group])),
            float(np.median([point.angle_error_deg for point in group])),
        )
        for group in groups.values()
        if len(group) == most
    ]
    return np.array(sorted(rows)).reshape(-1, 2)


def _draw_map(panel: Any, flow: PathDensityMap) -> Any:
    """Densities over places in colours, and lines along the way where it is clear."""
    density = _all_day(flow)
    places = density.sum(axis=2)
    size = np.array(places.shape)
    far = flow.corner + (size - 1) * flow.cell_m
    image = panel.imshow(
        np.log10(places / places.max()).T,
        origin="lower",
        extent=(flow.corner[0], far[0], flow.corner[1], far[1]),
        cmap="YlOrRd",
        vmin=-_DECADES,
        vmax=0,
    )
    angles = np.arange(DIRECTIONS) * 2 * np.pi / DIRECTIONS
    way, line = ((density * np.exp(1j * k * angles)).sum(axis=2) / places for k in (1, 2))
    step = max(round(_ARROW_EVERY_M / flow.cell_m), 1)
    often = np.log10(places / places.max()) > -_DECADES / 2
    shown = np.zeros(places.shape, dtype=bool)
    shown[step // 2 :: step, step // 2 :: step] = True
    one_way = np.abs(way) > _CLEAR
    both_ways = ~one_way & (np.abs(line) > _CLEAR)
    # Doubled angles are the same both ways.
    _draw_ways(panel, flow, shown & often & one_way, way, headed=True)
    _draw_ways(panel, flow, shown & often & both_ways, np.sqrt(line), headed=False)
    return image


def _draw_ways(panel: Any, flow: PathDensityMap, shown: Mask, way: Array, *, headed: bool) -> None:
    at = np.argwhere(shown)
    heads = {} if headed else {"headwidth": 0, "headlength": 0, "headaxislength": 0}
    panel.quiver(
        *(flow.corner + at * flow.cell_m).T, way[shown].real, way[shown].imag,
        angles="xy", scale_units="xy", scale=1 / _ARROW_M, pivot="mid", width=0.005,
        color="black", **heads,
    )  # fmt: skip


def _draw_view(panel: Any, learned: Learned, pose: CameraPose) -> None:
    """The camera, and what of the ground its picture's border frames, on three sides."""
    lens = learned.case.intrinsics
    across, down = (np.linspace(0, size - 1, _EDGE) for size in (lens.width, lens.height))
    border = np.concatenate(
        [
            np.stack([np.zeros(_EDGE), down], axis=1),
            np.stack([across, np.full(_EDGE, lens.height - 1.0)], axis=1),
            np.stack([np.full(_EDGE, lens.width - 1.0), down[::-1]], axis=1),
        ]
    )
    edge = _on_ground(learned, pose, border)
    panel.plot(*edge.T, color="black", linewidth=1.2, linestyle="--", label="edge of the view")
    panel.plot(0, 0, "^", color="black", markersize=9, label="camera")


def _on_ground(learned: Learned, pose: CameraPose, uv: Array) -> Array:
    """Places (N, 2) from the camera's foot; NaN above the horizon and beyond 150 m."""
    foot = np.array([0.0, 0.0, pose.height_m])
    ground, valid = ground_from_pixel(learned.case.intrinsics, pose.rotation, foot, uv)
    near = valid & (np.linalg.norm(ground, axis=1) < _FARTHEST_M)
    return np.where(near[:, None], ground, np.nan)


def _window(flow: PathDensityMap) -> tuple[Array, Array]:
    """Corners (2,) of a rectangle that holds the camera and nearly all people, with a border."""
    places = _all_day(flow).sum(axis=2)
    walked = np.argwhere(places > places.max() * 10.0 ** (-_DECADES / 2))
    ends = flow.corner + np.stack([walked.min(axis=0), walked.max(axis=0)]) * flow.cell_m
    ends = np.concatenate([ends, np.zeros((1, 2))])
    return ends.min(axis=0) - _AROUND_M, ends.max(axis=0) + _AROUND_M


def _all_day(flow: PathDensityMap) -> Array:
    """Densities (X, Y, 16) of all parts of the day together."""
    return np.asarray(np.exp(flow.log_density).mean(axis=0))
