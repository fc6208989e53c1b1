"""The figure of training speeds: a regressor for each pace that people might have.

The paper's error is a bowl with its floor where people really walk; where it was not, a frame rate
was wrong. So the same is done with a clock that is 2.5 times too slow, and what the service says of
either clock is told beside it.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from models.pose import learn_site, observe
from models.reasons import TracksCode
from models.regression.network import predict_windows
from models.regression.training import train
from models.tracks.scenes import Scene, load_scene
from models.tracks.trajectory import by_end
from studies.paper.centred_run import averaged_of
from studies.paper.measures import errors_of
from studies.paper.part import (
    SERVED_BY,
    TRAINED,
    Figures,
    OnShare,
    PaperCase,
    PaperPart,
    PaperResult,
    markdown,
    own_first,
)
from studies.paper.plots import plot_speeds
from studies.paper.regressors import AUTHORS_CODE, DEFAULT, PAPER, SERVED, plan_of

SPEEDS_MPS = tuple(round(0.2 * step, 1) for step in range(1, 21))
_SLOWNESS = 2.5  # people of 1.4 m/s seem to walk at 3.5, as on the paper's DM1
_SLOW = f", a clock {_SLOWNESS:g} times too slow"
SLOW_CLOCK = f"{DEFAULT}{_SLOW}"
RECIPES = (DEFAULT, SLOW_CLOCK, AUTHORS_CODE, PAPER)
_AT = " at "


def _cases(scenes: Sequence[str]) -> list[PaperCase]:
    """The quick recipe first, the paper's own scene first; the paper's recipe takes a night."""
    ordered = own_first(scenes)
    told = [(SERVED, scene) for scene in ordered] + [(f"{SERVED}{_SLOW}", ordered[0])]
    return [
        PaperCase(part="speed-sweep", scene=scene, variant=variant, seed=0)
        for variant, scene in told
    ] + [
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
    scene = load_scene(folder)
    if _SLOW in case.variant:
        scene = _by_a_slow_clock(scene)
    if case.variant.startswith(SERVED):
        return _said_of_the_clock(scene)
    recipe, speed_mps = parted(case.variant.replace(_SLOW, ""))
    plan = plan_of(scene, recipe, case.seed)
    plan = replace(plan, walk=replace(plan.walk, speed_mean_mps=speed_mps))
    network, _ = train(plan, lambda at: on_share(at.step / at.steps))
    predict = partial(predict_windows, network, plan=plan)
    estimate = averaged_of(predict, plan, [track.trajectory for track in scene.tracks])
    height_m, angle_deg = errors_of(estimate, scene)
    return {"height_m": height_m, "deg": angle_deg}


def _made_by(case: PaperCase) -> tuple[str, ...]:
    return SERVED_BY if case.variant.startswith(SERVED) else TRAINED


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
    why = site.implausible
    unusual = why is not None and why.code == TracksCode.SPEED_UNUSUAL
    return {"walking_speed_mps": site.walking_speed_mps, "clock_doubted": float(unusual)}


def _table(results: Sequence[PaperResult]) -> str:
    clocks = {
        (each.case.scene, _SLOW in each.case.variant): each.figures
        for each in results
        if each.case.variant.startswith(SERVED)
    }
    rows = []
    for (scene, recipe), found in _swept(results).items():
        floor = min(found, key=lambda speed: found[speed]["height_m"])
        rows.append(
            [
                scene,
                recipe,
                f"{len(found)} of {len(SPEEDS_MPS)}",
                f"{floor:g}",
                _words(clocks.get((scene, _SLOW in recipe))),
                *(_at(found, speed) for speed in (0.6, 1.0, 1.4, 1.8, 2.4, 3.6)),
            ]
        )
    header = ["scene", "recipe", "speeds", "floor, m/s", "the service's walking speed, m/s"]
    return markdown([*header, "0.6: off m, deg", "1.0", "1.4", "1.8", "2.4", "3.6"], rows)


def _swept(results: Sequence[PaperResult]) -> dict[tuple[str, str], dict[float, Figures]]:
    """Figures by speed, of each scene and recipe, in the order of the recipes."""
    trained = [each for each in results if not each.case.variant.startswith(SERVED)]
    rows: dict[tuple[str, str], dict[float, Figures]] = {}
    for each in sorted(trained, key=lambda one: (_order(one), parted(one.case.variant)[1])):
        recipe, speed_mps = parted(each.case.variant)
        rows.setdefault((each.case.scene, recipe), {})[speed_mps] = each.figures
    return rows


def _order(result: PaperResult) -> tuple[int, str]:
    return RECIPES.index(parted(result.case.variant)[0]), result.case.scene


def _words(clock: Figures | None) -> str:
    if clock is None:
        return ""
    doubted = ", which it doubts" if clock["clock_doubted"] else ""
    return f"{clock['walking_speed_mps']:.2f}{doubted}"


def _at(found: dict[float, Figures], speed_mps: float) -> str:
    if speed_mps not in found:
        return ""
    figures = found[speed_mps]
    return f"{figures['height_m']:.2f}, {figures['deg']:.1f}"


def _plot(results: Sequence[PaperResult], path: Path) -> None:
    if swept := _swept(results):  # else the service alone has answered yet
        plot_speeds(swept, path)


SPEED_SWEEP = PaperPart(
    says="the figure of training speeds: where a regressor's error has its floor",
    cases=_cases,
    run=_run,
    made_by=_made_by,
    table=_table,
    plot=_plot,
)
