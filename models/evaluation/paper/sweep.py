"""The figure of training speeds: a regressor for each pace that people might have.

The paper's error is a bowl with its floor where people really walk; where it was not, a frame rate
was wrong. So the same is done with a clock that is 2.5 times too slow, and what the service says of
that clock is told beside it.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from statistics import mean

import numpy as np

from models.evaluation.paper.part import (
    Figures,
    OnShare,
    PaperCase,
    PaperPart,
    PaperResult,
    markdown,
    own_first,
)
from models.evaluation.paper.regressors import DEFAULT, PAPER
from models.evaluation.scenes import Scene, load_scene
from models.evaluation.studies.centred_run import run_averaged
from models.reasons import TracksCode
from models.recalibration import learn_site, observe
from models.trajectory import by_end

SPEEDS_MPS = tuple(round(0.2 * step, 1) for step in range(1, 21))
SLOW_CLOCK = "default, a clock 2.5 times too slow"
RECIPES = (DEFAULT, SLOW_CLOCK, PAPER)
_SLOWNESS = 2.5  # people of 1.4 m/s seem to walk at 3.5, as on the paper's DM1
_AT = " at "


def _cases(scenes: Sequence[str]) -> list[PaperCase]:
    """The quick recipe first, the paper's own scene first; the paper's recipe takes a night."""
    ordered = own_first(scenes)
    return [
        PaperCase(part="speed-sweep", scene=scene, variant=f"{recipe}{_AT}{speed:g} m/s", seed=0)
        for recipe in RECIPES
        for scene in ordered
        for speed in SPEEDS_MPS
        if recipe != SLOW_CLOCK or scene == ordered[0]
    ]


def parted(variant: str) -> tuple[str, float]:
    """The recipe and the speed in m/s of a variant's name."""
    recipe, _, speed = variant.partition(_AT)
    return recipe, float(speed.removesuffix(" m/s"))


def _run(case: PaperCase, folder: Path, on_share: OnShare) -> Figures:
    recipe, speed_mps = parted(case.variant)
    scene = load_scene(folder)
    if recipe == SLOW_CLOCK:
        scene = _by_a_slow_clock(scene)
    run = run_averaged(
        scene,
        recipe_name=PAPER if recipe == PAPER else DEFAULT,
        seed=case.seed,
        training_speed_mps=speed_mps,
        on_progress=lambda at: on_share(at.step / at.steps),
    )
    return {
        "height_m": run.height_error_m,
        "deg": run.angle_error_deg,
        "training_s": run.training_s,
        **_said_of_the_clock(scene),
    }


def _by_a_slow_clock(scene: Scene) -> Scene:
    """The scene as told by a clock by which everything happens in less time."""
    tracks = []
    for track in scene.tracks:
        own = track.trajectory
        slow = replace(own, time_s=own.time_s[0] + (own.time_s - own.time_s[0]) / _SLOWNESS)
        tracks.append(replace(track, trajectory=slow))
    return replace(scene, tracks=tuple(tracks))


def _said_of_the_clock(scene: Scene) -> Figures:
    """How fast the service takes people to be, and whether it says that this cannot be."""
    told = (track.trajectory for track in scene.tracks)
    tracks = by_end(each for each in told if each.long_enough)
    lens, pose = scene.intrinsics, scene.true_pose
    site = learn_site(observe(tracks, lens, pose), lens, pose, chart=False).speed_reference
    unusual = site.doubt is not None and site.doubt.code == TracksCode.SPEED_UNUSUAL
    return {"walking_speed_mps": site.walking_speed_mps, "clock_doubted": float(unusual)}


def _table(results: Sequence[PaperResult]) -> str:
    rows = []
    for recipe in RECIPES:
        own = [each for each in results if parted(each.case.variant)[0] == recipe]
        for scene in sorted({each.case.scene for each in own}):
            found = {
                parted(each.case.variant)[1]: each.figures
                for each in own
                if each.case.scene == scene
            }
            floor = min(found, key=lambda speed: found[speed]["height_m"])
            told = mean(each["walking_speed_mps"] for each in found.values())
            doubted = any(each["clock_doubted"] for each in found.values())
            rows.append(
                [
                    scene,
                    recipe,
                    f"{len(found)} of {len(SPEEDS_MPS)}",
                    f"{floor:g}",
                    f"{told:.2f}{', which it doubts' if doubted else ''}",
                    *(_at(found, speed) for speed in (0.6, 1.0, 1.4, 1.8, 2.4, 3.6)),
                ]
            )
    header = ["scene", "recipe", "speeds", "floor, m/s", "the service's walking speed, m/s"]
    return markdown([*header, "0.6: off m, deg", "1.0", "1.4", "1.8", "2.4", "3.6"], rows)


def _at(found: dict[float, Figures], speed_mps: float) -> str:
    if speed_mps not in found:
        return ""
    figures = found[speed_mps]
    return f"{figures['height_m']:.2f}, {figures['deg']:.1f}"


def plot_sweep(results: Sequence[PaperResult], path: Path) -> None:
    """Height and angle error over training speed, a line for each scene and recipe."""
    from models.evaluation.paper.plots import panels

    figure, (left, right) = panels(2)
    for recipe, style in zip(RECIPES, ("-", ":", "--"), strict=True):
        own = [each for each in results if parted(each.case.variant)[0] == recipe]
        for number, scene in enumerate(sorted({each.case.scene for each in results})):
            points = np.array(
                sorted(
                    (parted(each.case.variant)[1], each.figures["height_m"], each.figures["deg"])
                    for each in own
                    if each.case.scene == scene
                )
            )
            if not len(points):
                continue
            name, color = f"{scene}, {recipe}", f"C{number}"
            left.plot(points[:, 0], points[:, 1], style, color=color, label=name)
            right.plot(points[:, 0], points[:, 2], style, color=color)
    left.set(xlabel="training speed, m/s", ylabel="height off, m", ylim=(0, None))
    right.set(xlabel="training speed, m/s", ylabel="angle off, deg", ylim=(0, None))
    left.legend(fontsize=6)
    figure.savefig(path, dpi=110)


SPEED_SWEEP = PaperPart(
    says="the figure of training speeds: where a regressor's error has its floor",
    cases=_cases,
    run=_run,
    table=_table,
    plot=plot_sweep,
)
