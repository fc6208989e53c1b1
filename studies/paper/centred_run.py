"""The averaged estimate on a recorded scene: train around the true pose, average, compare.

This is the paper's own experiment: the training range is centred on the truth.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from models.geometry.pose import CameraPose
from models.geometry.rotation import (
    Array,
    angle_between,
    quaternion_from_rotation,
    rotation_from_angles,
)
from models.regression.averaging import PoseEstimate, average_windows, averaged_estimate
from models.regression.network import predict_windows
from models.regression.recipe import TrainingPlan, TrainingProgress, plan_training
from models.regression.training import train
from models.simulation.walkers import WalkConfig
from models.tracks.scenes import Scene
from models.tracks.trajectory import Trajectory, Windows, choose_step_s, cut_windows


@dataclass(frozen=True, slots=True, kw_only=True)
class AveragedRun:
    """One training and its averaged estimate on one scene.

    `angle_error_deg` is the paper's: the whole averaged orientation, heading included.
    `served_angle_error_deg` has the heading of the prior pose, as the service answers.
    """

    scene: str
    recipe: str
    seed: int
    training_speed_mps: float
    step_s: float
    tracks: int
    true_height_m: float
    height_m: float
    tilt_deg: float
    roll_deg: float
    height_sd_m: float
    height_error_m: float
    angle_error_deg: float
    served_angle_error_deg: float
    held_out_height_error_m: float
    held_out_angle_error_deg: float
    held_out_passed: bool
    simulation_s: float
    training_s: float
    estimate_s: float


def run_averaged(
    scene: Scene,
    *,
    recipe_name: str,
    seed: int,
    training_speed_mps: float,
    epochs: int | None = None,
    on_progress: Callable[[TrainingProgress], None] = lambda _: None,
) -> AveragedRun:
    """Train for the scene's camera at its true pose, then average over its tracks.

    Raises:
        CalibrationError: the camera sees no ground, or too few tracks give a window.

    Source: Xu et al. 2020, sections 4.1 and 4.2; speeds as in the sweep of section 4.3.
    """
    trajectories = [track.trajectory for track in scene.tracks]
    step_s = choose_step_s(trajectories)
    plan = plan_training(
        intrinsics=scene.intrinsics,
        prior_pose=scene.true_pose,
        recipe_name=recipe_name,
        walk=WalkConfig(speed_mean_mps=training_speed_mps, step_s=step_s),
        seed=seed,
        epochs=epochs,
    )
    network, metrics = train(plan, on_progress)
    started = time.monotonic()
    estimate = averaged_of(partial(predict_windows, network, plan=plan), plan, trajectories)
    estimate_s = time.monotonic() - started
    found, truth = estimate.value, scene.true_pose
    served = pose_of(estimate, truth)
    return AveragedRun(
        scene=scene.scene_id,
        recipe=recipe_name,
        seed=seed,
        training_speed_mps=training_speed_mps,
        step_s=step_s,
        tracks=estimate.tracks,
        true_height_m=truth.height_m,
        height_m=found.height_m,
        tilt_deg=float(np.degrees(found.tilt_rad)),
        roll_deg=float(np.degrees(found.roll_rad)),
        height_sd_m=estimate.sd.height_m,
        height_error_m=abs(found.height_m - truth.height_m),
        angle_error_deg=whole_angle_deg(estimate, truth),
        served_angle_error_deg=_angle_deg(served.quaternion_wxyz, truth.quaternion_wxyz),
        held_out_height_error_m=metrics.median_height_error_m,
        held_out_angle_error_deg=metrics.median_angle_error_deg,
        held_out_passed=metrics.passed,
        simulation_s=metrics.simulation_s,
        training_s=metrics.training_s,
        estimate_s=estimate_s,
    )


def averaged_of(
    predict: Callable[[Windows], tuple[Array, Array]],
    plan: TrainingPlan,
    tracks: Sequence[Trajectory],
) -> PoseEstimate:
    """Mean prediction for tracks, of windows as long as those that were trained on.

    `predict` answers windows with heights (B,) in metres and unit quaternions wxyz (B, 4).

    Raises:
        TooFewTrajectoriesError: fewer than 5 tracks give a window.
    """
    walk = plan.walk
    windows = cut_windows(tracks, plan.intrinsics, walk.step_s, walk.max_points)
    height_m, quaternions = predict(windows)
    _, predictions = average_windows(height_m, quaternions, windows.owner_idx)
    return averaged_estimate(predictions, plan.seed)


def pose_of(estimate: PoseEstimate, prior: CameraPose) -> CameraPose:
    """The estimate as a pose; what is not identifiable (x, y, heading) is the prior pose's."""
    return replace(
        prior,
        height_m=max(estimate.value.height_m, 1e-3),
        tilt_rad=estimate.value.tilt_rad,
        roll_rad=estimate.value.roll_rad,
    )


def whole_angle_deg(estimate: PoseEstimate, truth: CameraPose) -> float:
    """The paper's angle error: of the whole averaged orientation, its heading included."""
    found = estimate.value
    raw = rotation_from_angles(found.tilt_rad, found.roll_rad, found.heading_rad)
    return _angle_deg(quaternion_from_rotation(raw), truth.quaternion_wxyz)


def _angle_deg(first: np.ndarray, second: Array) -> float:
    return float(np.degrees(angle_between(first, second)))
