"""Table 3: orientations by vanishing points of heads and feet, of single walkers and of all.

Tops of boxes are taken for heads, as the paper took them; and ideal heads, simulated over the real
feet with a jitter of 3 % of the stature, for what the method could do if heads were seen.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from statistics import mean, median

import numpy as np

from models.errors import TooFewTrajectoriesError
from models.geometry.pose import CameraPose
from models.geometry.rotation import angle_between, angles_from_rotation, quaternion_from_rotation
from models.tracks.scenes import Scene, load_scene
from models.tracks.trajectory import Trajectory
from studies.baselines.vanishing_points import (
    orientation_of_walker,
    rays_of,
    tilt_and_roll,
    up_of_walkers,
)
from studies.paper.part import (
    Figures,
    OnShare,
    PaperCase,
    PaperPart,
    PaperResult,
    by_row,
    markdown,
    with_boxes,
)
from studies.protocol.cases import angle_deg
from studies.simulation.heads import HeadConfig, with_box_heads, with_heads

_BOXES, _IDEAL = "tops of boxes", "ideal heads, 3 % jitter"
_SEEDS = (0, 1, 2)
_WALKERS = 3  # as in the paper
_PUBLISHED = {"town_centre": "86.2, 84.3, 89.2"}


def _cases(scenes: Sequence[str]) -> list[PaperCase]:
    drawn = [(_IDEAL, seed, scene) for scene in scenes for seed in _SEEDS]
    real = [(_BOXES, 0, scene) for scene in with_boxes(scenes)]
    return [
        PaperCase(part="vanishing-points", scene=scene, variant=variant, seed=seed)
        for variant, seed, scene in real + drawn
    ]


def _run(case: PaperCase, folder: Path, on_share: OnShare) -> Figures:
    scene = load_scene(folder)
    tracks = [track.trajectory for track in scene.tracks]
    if case.variant == _BOXES:
        tracks = with_box_heads(tracks)
    else:
        rng = np.random.default_rng(case.seed)
        tracks = with_heads(tracks, scene.intrinsics, scene.true_pose, HeadConfig(), rng)
    figures: Figures = {}
    farthest = sorted(tracks, key=lambda track: -_way_seen(scene, track))[:_WALKERS]
    for number, track in enumerate(farthest, 1):
        try:
            rotation = orientation_of_walker(scene.intrinsics, track)
        except TooFewTrajectoriesError:
            continue
        tilt, roll, _ = (float(angle) for angle in angles_from_rotation(rotation))
        whole = angle_between(quaternion_from_rotation(rotation), scene.true_pose.quaternion_wxyz)
        figures[f"walker_{number}_whole_deg"] = math.degrees(float(whole))
        figures[f"walker_{number}_deg"] = _off_deg(tilt, roll, scene.true_pose)
    up = up_of_walkers(scene.intrinsics, tracks)
    return figures | {"all_deg": _off_deg(*tilt_and_roll(up), scene.true_pose)}


def _way_seen(scene: Scene, track: Trajectory) -> float:
    """Angle in the picture between a track's begin and end, where a head is known; in radians."""
    feet, _ = rays_of(scene.intrinsics, track)
    return math.acos(min(1.0, float(feet[0] @ feet[-1]))) if len(feet) else 0.0


def _off_deg(tilt_rad: float, roll_rad: float, truth: CameraPose) -> float:
    """The error of tilt and roll together, were the heading right."""
    return angle_deg(replace(truth, tilt_rad=tilt_rad, roll_rad=roll_rad), truth)


def _table(results: Sequence[PaperResult]) -> str:
    rows = []
    for (scene, variant), found in by_row(results).items():
        rows.append(
            [
                scene,
                variant,
                _walkers(found, "_whole_deg"),
                _PUBLISHED.get(scene, "") if variant == _BOXES else "",
                _walkers(found, "_deg"),
                f"{mean(each['all_deg'] for each in found):.1f}",
            ]
        )
    header = [
        "scene",
        "heads",
        "whole rotation, three walkers, deg",
        "published",
        "tilt and roll, the same, deg",
        "tilt and roll, all walkers, deg",
    ]
    return markdown(header, rows)


def _walkers(found: Sequence[Figures], ending: str) -> str:
    """Each walker's figure, the median of the seeds."""
    names = [f"walker_{number}{ending}" for number in range(1, _WALKERS + 1)]
    columns = [[each[name] for each in found if name in each] for name in names]
    return ", ".join(f"{median(values):.1f}" if values else "none" for values in columns)


VANISHING_POINTS = PaperPart(
    says="table 3: orthogonal vanishing points of a walker's heads and feet",
    cases=_cases,
    run=_run,
    made_by=lambda _: ("studies.baselines.vanishing_points", "studies.simulation.heads"),
    table=_table,
)
