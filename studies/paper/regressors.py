"""Table 1, theirs: regressors of one camera each, beside a constant and what is served.

Centred as in the paper, where the training's range has the truth in its middle; and knocked, where
it has not. Of what the paper leaves open there are variants, on its own scene. A training's result
is that of its last epoch; beside it, that of the epoch which does best on held-out simulated walks,
and that of the epoch which does best on the very tracks it is then measured by.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch

from models.regression.dataset import SyntheticSet, held_out_set
from models.regression.network import PoseRegressor, predict_windows
from models.regression.recipe import Recipe, TrainingPlan
from models.regression.training import batch_loss, train
from models.simulation.poses import PoseRange
from models.tracks.scenes import Scene, load_scene
from studies.paper.centred_run import averaged_of
from studies.paper.measures import (
    centred_plan,
    errors_of,
    knocked_figures,
    still_figures,
    trained_figures,
)
from studies.paper.part import SERVED_BY, TRAINED, Figures, OnShare, PaperCase
from studies.protocol.cases import Answer, ProtocolCase, nothing_identifiable
from studies.protocol.flow_runs import fused
from studies.protocol.learned import learn_case

CONSTANT, SERVED, DEFAULT, PAPER = "constant", "served", "default", "paper"
AUTHORS_CODE = "paper, 5,145 walks, 25 epochs"
_HELD_OUT = 500

Change = Callable[[TrainingPlan], TrainingPlan]


def _recipe(**changes: Any) -> Change:
    return lambda plan: replace(plan, recipe=replace(plan.recipe, **changes))


def _walk(**changes: Any) -> Change:
    return lambda plan: replace(plan, walk=replace(plan.walk, **changes))


# The authors' public code trains on 5,145 walks, 15 of each of 7 x 7 x 7 poses, for 25 epochs.
_COARSE = PoseRange(height_step_m=1.0, angle_step_rad=math.radians(5))
_reduced = _recipe(spread=_COARSE, walks_per_pose=15, epochs=25)
_LEFT_OPEN = {
    "steps of 1 s": _walk(step_s=1.0),
    "up to 35 points": _walk(max_points=35),
    "learning rate 1e-4": _recipe(learning_rate=1e-4),
    "learning rate falls to 0": _recipe(schedule="cosine"),
}


def _both(one: Change, other: Change) -> Change:
    return lambda plan: other(one(plan))


VARIANTS: dict[str, Change] = {
    PAPER: lambda plan: plan,
    **{f"{PAPER}, {name}": change for name, change in _LEFT_OPEN.items()},
    AUTHORS_CODE: _reduced,
    **{f"{AUTHORS_CODE}, {name}": _both(_reduced, change) for name, change in _LEFT_OPEN.items()},
}


def run_case(case: PaperCase, folder: Path, on_share: OnShare) -> Figures:
    """The figures of a row of table 1 on a scene, for one seed of its training."""
    scene = load_scene(folder)
    untrained = {CONSTANT: nothing_identifiable, SERVED: served_answer}
    if case.variant in untrained:
        estimator = untrained[case.variant]
        return still_figures(scene, estimator) | knocked_figures(scene, estimator)
    return _trained(scene, plan_of(scene, case.variant, case.seed), on_share)


def made_by(case: PaperCase) -> tuple[str, ...]:
    """The modules that make a row's figures."""
    untrained = {CONSTANT: ("models.simulation.poses",), SERVED: SERVED_BY}
    return untrained.get(case.variant, TRAINED)


def plan_of(scene: Scene, variant: str, seed: int) -> TrainingPlan:
    """A training by a recipe, or one of `VARIANTS` of the paper's, around a scene's true pose."""
    if variant == DEFAULT:
        return centred_plan(scene, DEFAULT, seed)
    return VARIANTS[variant](centred_plan(scene, PAPER, seed))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Epoch:
    """After an epoch: its loss on held-out walks, on the real tracks, and the errors there."""

    held_out: float
    test: float
    height_m: float
    angle_deg: float


def _trained(scene: Scene, plan: TrainingPlan, on_share: OnShare) -> Figures:
    tracks = [track.trajectory for track in scene.tracks]
    held_out = held_out_set(plan, _HELD_OUT, np.random.default_rng([plan.seed, 3]))
    epochs: list[_Epoch] = []
    looking_s = 0.0

    def look(network: PoseRegressor) -> None:
        nonlocal looking_s
        begun = time.process_time()
        predict = partial(predict_windows, network, plan=plan)
        height_m, angle_deg = errors_of(averaged_of(predict, plan, tracks), scene)
        # |q - q'| of unit quaternions is twice the sine of a quarter of the angle.
        orientation = 2 * math.sin(math.radians(angle_deg) / 4)
        epochs.append(
            _Epoch(
                held_out=_loss_on(network, held_out, plan.recipe),
                test=height_m + plan.recipe.alpha * orientation,
                height_m=height_m,
                angle_deg=angle_deg,
            )
        )
        looking_s += time.process_time() - begun

    by_epoch = plan.recipe.target == "pose"
    begun = time.process_time()
    network, metrics = train(
        plan,
        lambda at: on_share(at.step / at.steps),
        look if by_epoch else lambda _: None,
    )
    training_cpu_s = time.process_time() - begun - looking_s
    predict = partial(predict_windows, network, plan=plan)
    figures = trained_figures(scene, plan, predict) | {
        "held_out_height_m": metrics.median_height_error_m,
        "held_out_deg": metrics.median_angle_error_deg,
        "training_cpu_s": training_cpu_s,
    }
    if by_epoch:
        by_held_out = min(epochs, key=lambda epoch: epoch.held_out)
        by_test = min(epochs, key=lambda epoch: epoch.test)
        figures |= {
            "by_held_out_height_m": by_held_out.height_m,
            "by_held_out_deg": by_held_out.angle_deg,
            "by_test_height_m": by_test.height_m,
            "by_test_deg": by_test.angle_deg,
        }
    return figures


def served_answer(case: ProtocolCase) -> Answer:
    """Answer that the service would serve, with all that a site's reference teaches it."""
    return fused(learn_case(case))


def _loss_on(network: PoseRegressor, data: SyntheticSet, recipe: Recipe) -> float:
    """The mean loss of a whole set, which nothing is learned of."""
    with torch.inference_mode():
        return float(batch_loss(network, data, np.arange(len(data)), recipe))
