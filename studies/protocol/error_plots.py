"""The plots of `python -m studies evaluate`."""

from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from itertools import product
from pathlib import Path

from models.tracks.scenes import load_scene
from studies.protocol.cases import (
    KNOCKED,
    PANNED,
    Outcome,
    draw_case,
    pose_of_plane_parameters,
)
from studies.protocol.estimators import joint, track_errors
from studies.protocol.flow_curves import CurvePoint, flow_errors
from studies.protocol.flow_plots import plot_flow, plot_flow_errors
from studies.protocol.flow_runs import fused
from studies.protocol.learned import learn_case
from studies.protocol.plots import plot_drift, plot_ground, plot_track_errors
from studies.protocol.report import ENOUGH_TRACKS

_CURVE_TRACKS = [10, 20, 40, 80, 160, 320]


def draw_plots(
    folder: Path,
    scenes: Sequence[Path],
    seeds: int,
    outcomes: Mapping[str, Sequence[Outcome]],
    pool: ProcessPoolExecutor,
) -> None:
    """Write the PNG of each knock's outcomes, of each scene, and of errors over tracks."""
    folder.mkdir(parents=True, exist_ok=True)
    for knock, own in outcomes.items():
        if knock != "still":
            plot_drift(own, folder / f"drift-{knock}.png")
    for scene in scenes:
        learned = learn_case(draw_case(load_scene(scene), 0, KNOCKED))
        plot_ground(learned.case, joint(learned).values, folder / f"ground-{scene.name}.png")
        _draw_flow(scene, folder / f"flow-{scene.name}.png")
    enough = [
        scene
        for scene in scenes
        if len(draw_case(load_scene(scene), 0, KNOCKED).seen) >= ENOUGH_TRACKS
    ]
    pairs = list(product(enough, range(seeds)))
    curves: dict[str, list[tuple[int, float, float]]] = {}
    for (scene, _), points in zip(pairs, pool.map(_curve, pairs), strict=True):
        curves.setdefault(scene.name, []).extend(points)
    if curves:
        plot_track_errors(curves, folder / "tracks.png")
    pairs = list(product(scenes, range(seeds)))
    flow_curves: dict[str, list[CurvePoint]] = {}
    for (scene, _), found in zip(pairs, pool.map(_flow_curve, pairs), strict=True):
        flow_curves.setdefault(scene.name, []).extend(found)
    plot_flow_errors(flow_curves, folder / "flow-tracks.png")


def _draw_flow(scene: Path, path: Path) -> None:
    """The flow map under new tracks by the prior and by the fused pose, where there is a map."""
    learned = learn_case(draw_case(load_scene(scene), 0, PANNED))
    answer = fused(learned)
    if learned.site.paths is None or answer.heading_rad is None:
        return
    prior = learned.case.prior_pose
    pose = replace(pose_of_plane_parameters(answer.values, prior), heading_rad=answer.heading_rad)
    plot_flow(learned, {"new tracks by the prior pose": prior, "by the fused pose": pose}, path)


def _curve(pair: tuple[Path, int]) -> list[tuple[int, float, float]]:
    scene, seed = pair
    return track_errors(load_scene(scene), seed, _CURVE_TRACKS)


def _flow_curve(pair: tuple[Path, int]) -> list[CurvePoint]:
    scene, seed = pair
    return flow_errors(load_scene(scene), seed, _CURVE_TRACKS)
