"""What a set network says of the tracks of a camera, beside those of its reference."""

import math
from dataclasses import replace

import numpy as np
import torch

from models.errors import TooFewTrajectoriesError
from models.estimation.averaged import FEWEST_TRACKS
from models.estimation.parameters import PlaneEstimate, plane_parameters_of
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array
from models.regression.set_features import FEATURES, usual_speeds, walking, window_features
from models.regression.set_network import SetNetwork
from models.regression.set_training import SCALE, SetPlan
from models.trajectory import Windows

_ROUNDS = 2  # looks after the first, each from where the last one ended
_FARTHEST = np.array([0.4, 0.4, 0.7])  # radians of tilt and roll, log height from the prior


def set_estimate(
    network: SetNetwork, plan: SetPlan, seen: Windows, reference: Windows | None
) -> PlaneEstimate:
    """Tilt, roll and log height from all windows at once.

    The windows are looked at from the prior pose, then again from the pose that the network found:
    what is left there is small, where the network is sharpest. A reference of walkers seen from
    the prior pose tells the site's pace, stands beside what is seen, and, seen itself, shows what
    the network is off on this site; that is taken off every look.

    Raises:
        TooFewTrajectoriesError: fewer than 5 tracks of people who walk.
    """
    known, speed = np.zeros((0, FEATURES)), plan.walk.speed_mean_mps
    bias, bias_sd = np.zeros(3), np.zeros(3)
    if reference is not None and len(reference):
        first = _look(plan, reference, plan.prior_pose, speed)
        there = np.ones((1, len(first)), dtype=np.bool_)
        speed = float(usual_speeds(first[None], there, speed)[0])
        known, _ = _walkers(plan, reference, plan.prior_pose, speed)
        if len(known):
            bias, bias_sd = _ask(network, known, known)
    offset, sd = np.zeros(3), np.zeros(3)
    for _ in range(1 + _ROUNDS):
        pose = _moved(plan.prior_pose, offset)
        features, tracks = _walkers(plan, seen, pose, speed)
        if tracks < FEWEST_TRACKS:
            raise TooFewTrajectoriesError(
                f"tracks: at least {FEWEST_TRACKS} of people who walk are needed, got {tracks}"
            )
        step, sd = _ask(network, features, known)
        offset = np.clip(offset + step - bias, -_FARTHEST, _FARTHEST)
    return PlaneEstimate(
        values=plane_parameters_of(plan.prior_pose) + offset,
        covariance=np.diag(np.square(sd) + np.square(bias_sd)),
        tracks=tracks,
    )


def _ask(network: SetNetwork, seen: Array, reference: Array) -> tuple[Array, Array]:
    """The offset (3,) from the pose looked from, and its standard deviations (3,)."""
    with torch.inference_mode():
        mean, log_sd = network(
            torch.from_numpy(seen.astype(np.float32))[None],
            torch.ones(1, len(seen)),
            torch.from_numpy(reference.astype(np.float32))[None],
            torch.ones(1, len(reference)),
        )
    return mean[0].double().numpy() * SCALE, np.exp(log_sd[0].double().numpy()) * SCALE


def _walkers(
    plan: SetPlan, windows: Windows, pose: CameraPose, speed_mps: float
) -> tuple[Array, int]:
    """Features (W, F) of the windows of people who walk, seen from a pose, and their tracks."""
    features = _look(plan, windows, pose, speed_mps)
    kept = walking(features[None], np.ones((1, len(features)), dtype=np.bool_))[0]
    return features[kept], int(np.unique(windows.owner_idx[kept]).size)


def _look(plan: SetPlan, windows: Windows, pose: CameraPose, speed_mps: float) -> Array:
    return window_features(
        windows, plan.intrinsics, pose, plan.prior_pose, speed_mps, plan.walk.step_s
    )


def _moved(prior: CameraPose, offset: Array) -> CameraPose:
    tilt, roll, log_height = (float(number) for number in offset)
    return replace(
        prior,
        height_m=prior.height_m * math.exp(log_height),
        tilt_rad=float(np.clip(prior.tilt_rad + tilt, -math.pi / 2, math.pi / 2)),
        roll_rad=prior.roll_rad + roll,
    )
