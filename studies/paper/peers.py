"""Peers: cameratransform by box heights beside what is served, after knocks, on real boxes."""

import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from statistics import fmean, median

import numpy as np

from models.tracks.scenes import load_scene
from studies.baselines.box_heights import pose_by_box_heights
from studies.paper.measures import KNOCKS, outcomes_of
from studies.paper.part import (
    SERVED_BY,
    Figures,
    OnShare,
    PaperCase,
    PaperPart,
    PaperResult,
    markdown,
    with_boxes,
)
from studies.paper.regressors import SERVED, served_answer
from studies.protocol.cases import (
    KNOCKED,
    Answer,
    Estimator,
    ProtocolCase,
)
from studies.protocol.regressors import without_offset

_ALONE, _BESIDE = "cameratransform", "cameratransform, our reference's offset off"
_VARIANTS = (_ALONE, _BESIDE, SERVED)


def _cases(scenes: Sequence[str]) -> list[PaperCase]:
    return [
        PaperCase(part="peers", scene=scene, variant=variant, seed=0)
        for scene in with_boxes(scenes)
        for variant in _VARIANTS
    ]


def _by_heights(case: ProtocolCase, *, beside: bool) -> Answer:
    read = partial(pose_by_box_heights, case.intrinsics, prior=case.prior_pose)
    found = read(tracks=case.seen)
    if beside:
        found = without_offset(found, read(tracks=case.reference), case.prior_pose)
    return Answer(values=found.values, covariance=found.covariance, tracks=found.tracks)


def _run(case: PaperCase, folder: Path, on_share: OnShare) -> Figures:
    scene = load_scene(folder)
    estimator: Estimator = served_answer
    if case.variant != SERVED:
        estimator = partial(_by_heights, beside=case.variant == _BESIDE)
    outcomes = outcomes_of(scene, estimator, KNOCKED)
    return {
        "deg": median(each.tilt_roll_error_deg for each in outcomes),
        "height_share": median(each.height_error for each in outcomes),
        "covered": fmean(float(np.mean(each.covered)) for each in outcomes),
        "worst_deg": max(each.tilt_roll_error_deg for each in outcomes),
    }


def _made_by(case: PaperCase) -> tuple[str, ...]:
    return SERVED_BY if case.variant == SERVED else ("studies.baselines.box_heights",)


def _table(results: Sequence[PaperResult]) -> str:
    rows = []
    for variant in _VARIANTS:
        found = sorted(
            (each for each in results if each.case.variant == variant),
            key=lambda each: each.case.scene,
        )
        rows += [_row(variant, each.case.scene, [each.figures]) for each in found]
        if len(found) > 1:
            rows.append(_row(variant, "median", [each.figures for each in found]))
    header = ["estimator", "scene", "tilt and roll off, deg", "height off, %"]
    return markdown([*header, "worst of the knocks, deg", "90 % intervals hold, %"], rows)


def _row(variant: str, scene: str, found: Sequence[Figures]) -> list[str]:
    middle = {name: median(each[name] for each in found) for name in found[0]}
    covered = middle["covered"]
    return [
        variant,
        scene,
        f"{middle['deg']:.2f}",
        f"{100 * middle['height_share']:.1f}",
        f"{middle['worst_deg']:.1f}",
        "none" if math.isnan(covered) else f"{100 * covered:.0f}",
    ]


PEERS = PaperPart(
    says=f"peers: {KNOCKS} knocks of up to 8 deg and 15 % on the scenes with real boxes",
    cases=_cases,
    run=_run,
    made_by=_made_by,
    table=_table,
)
