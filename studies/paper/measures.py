"""Measures of every estimator of the paper's study: in the middle, and after pose offsets."""

import math
from collections.abc import Callable, Iterable, Sequence
from statistics import median

import numpy as np

from models.errors import TooFewTrajectoriesError
from models.geometry.pose import plane_parameters_of
from models.geometry.rotation import Array
from models.regression.averaging import PoseEstimate
from models.regression.recipe import TrainingPlan, plan_training
from models.simulation.walkers import WalkConfig
from models.tracks.scenes import Scene
from models.tracks.trajectory import Windows, choose_step_s
from studies.faults.catalogue import Fault
from studies.paper.centred_run import averaged_of, pose_of, whole_angle_deg
from studies.paper.part import Figures
from studies.protocol.cases import (
    KNOCKED,
    STILL,
    Answer,
    Estimator,
    OffsetRange,
    Outcome,
    ProtocolCase,
    draw_case,
    judge_answer,
    nothing_identifiable,
)
from studies.slopes import slope_with_error

KNOCKS = 12

Predict = Callable[[Windows], tuple[Array, Array]]


def centred_plan(scene: Scene, recipe_name: str, seed: int) -> TrainingPlan:
    """A training around a scene's true pose, as the paper has it; its step is one of its tracks."""
    return plan_training(
        intrinsics=scene.intrinsics,
        prior_pose=scene.true_pose,
        recipe_name=recipe_name,
        walk=WalkConfig(step_s=choose_step_s([track.trajectory for track in scene.tracks])),
        seed=seed,
    )


def trained_figures(scene: Scene, plan: TrainingPlan, predict: Predict) -> Figures:
    """The figures of a network that was trained at the scene's true pose.

    Raises:
        TooFewTrajectoriesError: fewer than 5 tracks of the scene give a window.
    """

    def averaged(case: ProtocolCase) -> Answer:
        try:
            estimate = averaged_of(predict, plan, case.seen)
        except TooFewTrajectoriesError:
            return nothing_identifiable(case)
        values = plane_parameters_of(pose_of(estimate, case.prior_pose))
        return Answer(values=values, covariance=np.eye(3), tracks=estimate.tracks)

    estimate = averaged_of(predict, plan, [track.trajectory for track in scene.tracks])
    height_m, angle_deg = errors_of(estimate, scene)
    figures = {
        "tracks": float(estimate.tracks),
        "centred_height_m": height_m,
        "centred_deg": angle_deg,
    }
    return figures | knocked_figures(scene, averaged)


def errors_of(estimate: PoseEstimate, scene: Scene) -> tuple[float, float]:
    """Of the height in metres, and of the whole orientation in degrees, as the paper has it."""
    truth = scene.true_pose
    return abs(estimate.value.height_m - truth.height_m), whole_angle_deg(estimate, truth)


def outcomes_of(
    scene: Scene,
    estimator: Estimator,
    offset_range: OffsetRange,
    seeds: Iterable[int] = range(KNOCKS),
    fault: Fault | None = None,
) -> list[Outcome]:
    """An estimator's answers to knocks of a scene's camera, beside the truth."""
    cases = (draw_case(scene, seed, offset_range, fault=fault) for seed in seeds)
    return [judge_answer(case, "", estimator(case), 0.0) for case in cases]


def middle_errors(scene: Scene, outcomes: Sequence[Outcome]) -> tuple[float, float]:
    """The medians of height in metres, and of tilt and roll together in degrees.

    Were the heading right: regressors are given it, and no knock here turns it.
    """
    height_m = scene.true_pose.height_m * median(each.height_error for each in outcomes)
    return height_m, median(each.tilt_roll_error_deg for each in outcomes)


def still_figures(scene: Scene, estimator: Estimator) -> Figures:
    """Errors on a still camera, of one half of the people after the other: the middle of 12."""
    height_m, angle_deg = middle_errors(scene, outcomes_of(scene, estimator, STILL))
    return {"centred_height_m": height_m, "centred_deg": angle_deg}


def knocked_figures(scene: Scene, estimator: Estimator) -> Figures:
    """The middle errors of 12 pose offsets, and the slopes of what is found over what is true."""
    outcomes = outcomes_of(scene, estimator, KNOCKED)
    figures = {
        "knocked_share": median(each.height_error for each in outcomes),
        "knocked_deg": median(each.tilt_roll_error_deg for each in outcomes),
    }
    true, found = (
        np.array([getattr(each, name) for each in outcomes]) for name in ("true_drift", "drift")
    )
    for axis, name in enumerate(("tilt", "roll", "height")):
        slope, _ = slope_with_error(true[:, axis], found[:, axis])
        figures[f"slope_{name}"] = math.nan if slope is None else slope
    return figures
