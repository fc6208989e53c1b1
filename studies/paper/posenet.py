"""Table 1, PoseNet's: the sweep of the weight of the orientation, alpha, and what it costs."""

import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from models.tracks.scenes import load_scene
from studies.baselines.posenet import parameters_of, read_windows, train_posenet
from studies.paper.measures import centred_plan, trained_figures
from studies.paper.part import (
    PAPERS_OWN,
    TRAINED,
    Figures,
    OnShare,
    PaperCase,
    PaperPart,
    PaperResult,
    markdown,
    own_first,
)

# By alpha, on Town Centre: metres and degrees.
_PUBLISHED = {
    1: (0.27, 4.99),
    10: (0.23, 5.13),
    50: (0.29, 4.96),
    100: (0.26, 4.85),
    500: (0.22, 4.41),
    1000: (0.34, 4.60),
    2000: (0.26, 4.62),
    5000: (0.26, 4.34),
}
_EPOCHS = 4  # the loss on other walks falls no more from then on


def _cases(scenes: Sequence[str]) -> list[PaperCase]:
    return [
        PaperCase(part="posenet", scene=scene, variant=str(alpha), seed=0)
        for scene in own_first(scenes)
        for alpha in _PUBLISHED
    ]


def _run(case: PaperCase, folder: Path, on_share: OnShare) -> Figures:
    scene = load_scene(folder)
    plan = centred_plan(scene, "paper", case.seed)
    begun = time.process_time()
    network = train_posenet(plan, alpha=float(case.variant), epochs=_EPOCHS, on_share=on_share)
    training_cpu_s = time.process_time() - begun
    figures = trained_figures(scene, plan, partial(read_windows, network, plan=plan))
    return figures | {"training_cpu_s": training_cpu_s, "parameters": float(parameters_of(network))}


def _table(results: Sequence[PaperResult]) -> str:
    rows = []
    for each in sorted(results, key=lambda one: (one.case.scene, int(one.case.variant))):
        found, alpha = each.figures, int(each.case.variant)
        height_m, angle_deg = _PUBLISHED[alpha]
        rows.append(
            [
                each.case.scene,
                str(alpha),
                f"{found['centred_height_m']:.2f}, {found['centred_deg']:.2f}",
                f"{height_m:.2f}, {angle_deg:.2f}" if each.case.scene == PAPERS_OWN else "",
                f"{100 * found['knocked_share']:.1f}, {found['knocked_deg']:.2f}",
                ", ".join(f"{found[f'slope_{name}']:.2f}" for name in ("tilt", "roll", "height")),
                f"{found['training_cpu_s']:.0f}",
            ]
        )
    header = [
        "scene",
        "alpha",
        "centred: off m, deg",
        "published",
        "knocked: off %, deg",
        "slope of tilt, roll, height",
        "training, CPU-s",
    ]
    return markdown(header, rows)


POSENET = PaperPart(
    says="table 1, PoseNet: a walk as a picture, white on black, by the weight of the orientation",
    cases=_cases,
    run=_run,
    made_by=lambda _: ("studies.baselines.posenet", *TRAINED),
    table=_table,
)
