"""Table 4: what a flight of stairs, or a ramp, in a part of the picture costs.

Real people's tracks are lifted on to simulated stairs. The paper's measure is a trained regressor's
error on all tracks, in the middle of its range; of what is served it is that after knocks, since a
reference has seen the stairs as well.
"""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from statistics import median

from models.regression.network import predict_windows
from models.regression.recipe import TrainingPlan
from models.regression.training import train
from models.tracks.scenes import Scene, load_scene
from studies.faults.catalogue import Fault
from studies.faults.lens_and_ground import ramp, stairs
from studies.faults.view import view_of
from studies.paper.centred_run import averaged_of
from studies.paper.measures import errors_of, middle_errors, outcomes_of
from studies.paper.part import (
    SERVED_BY,
    TRAINED,
    Figures,
    OnShare,
    PaperCase,
    PaperPart,
    PaperResult,
    by_row,
    markdown,
)
from studies.paper.regressors import (
    AUTHORS_CODE,
    DEFAULT,
    SERVED,
    plan_of,
    served_answer,
)
from studies.protocol.cases import KNOCKED

_HIGHEST_M, _HIGHEST_SHARE = 2.0, 0.25  # of a flight: a floor's half, and of the camera's height
_RAMP = 0.1
_GROUNDS = ("flat", "stairs", "ramp")
_VARIANTS = (SERVED, DEFAULT, AUTHORS_CODE)
_SEEDS = (0, 1, 2)
_KNOCKS = 4  # a seed


def _cases(scenes: Sequence[str]) -> list[PaperCase]:
    return [
        PaperCase(part="stairs", scene=scene, variant=variant, seed=seed)
        for variant in _VARIANTS
        for seed in _SEEDS
        for scene in scenes
    ]


def _run(case: PaperCase, folder: Path, on_share: OnShare) -> Figures:
    scene = load_scene(folder)
    if case.variant == SERVED:
        return _served(scene, case.seed)
    return _averaged(scene, plan_of(scene, case.variant, case.seed), on_share)


def _faults(scene: Scene) -> dict[str, Fault | None]:
    """Faults of the ground, by `_GROUNDS`."""
    flight_m = min(_HIGHEST_M, _HIGHEST_SHARE * scene.true_pose.height_m)
    faults = (
        None,
        Fault(injector=stairs, size=flight_m, words=f"a flight of {flight_m:.1f} m"),
        Fault(injector=ramp, size=_RAMP, words="10 % over half of the places"),
    )
    return dict(zip(_GROUNDS, faults, strict=True))


def _averaged(scene: Scene, plan: TrainingPlan, on_share: OnShare) -> Figures:
    network, _ = train(plan, lambda at: on_share(at.step / at.steps))
    predict = partial(predict_windows, network, plan=plan)
    view = view_of(scene)
    figures: Figures = {}
    for ground, fault in _faults(scene).items():
        tracks = scene.tracks if fault is None else fault.inject(scene.tracks, view, plan.seed)
        estimate = averaged_of(predict, plan, [track.trajectory for track in tracks])
        height_m, angle_deg = errors_of(estimate, scene)
        figures |= {f"{ground}_height_m": height_m, f"{ground}_deg": angle_deg}
    return figures


def _served(scene: Scene, seed: int) -> Figures:
    figures: Figures = {}
    seeds = range(seed * _KNOCKS, (seed + 1) * _KNOCKS)
    for ground, fault in _faults(scene).items():
        outcomes = outcomes_of(scene, served_answer, KNOCKED, seeds, fault)
        height_m, angle_deg = middle_errors(scene, outcomes)
        figures |= {f"{ground}_height_m": height_m, f"{ground}_deg": angle_deg}
    return figures


def _table(results: Sequence[PaperResult]) -> str:
    rows = []
    for (scene, variant), found in by_row(results).items():
        middle = {name: median(each[name] for each in found) for name in found[0]}
        row = [scene, variant, str(len(found))]
        row += [f"{middle[f'{ground}_height_m']:.2f}, {middle[f'{ground}_deg']:.2f}"
                for ground in _GROUNDS]  # fmt: skip
        row += [
            ", ".join(
                f"{middle[f'{ground}_{what}'] / max(middle[f'flat_{what}'], 1e-9):.1f}"
                for what in ("height_m", "deg")
            )
            for ground in ("stairs", "ramp")
        ]
        rows.append(row)
    header = ["scene", "estimator", "seeds"]
    header += [f"{ground}: off m, deg" for ground in _GROUNDS]
    header += ["stairs over flat", "ramp over flat"]
    return markdown(header, rows)


STAIRS = PaperPart(
    says="table 4: stairs and ramps in a part of the picture, medians of the seeds",
    cases=_cases,
    run=_run,
    made_by=lambda case: SERVED_BY if case.variant == SERVED else TRAINED,
    table=_table,
)
