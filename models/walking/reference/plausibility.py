"""Plausibility of a reference: its speeds, statures, and a free pose beside the prior."""

from dataclasses import replace

import numpy as np

from models.geometry.pose import CameraPose, plane_parameters_of
from models.reasons import Reason, TracksCode
from models.tracks.observations import Observations
from models.walking import config
from models.walking.estimate import joint_estimate
from models.walking.speed_reference import SpeedReference


def implausibility_of(
    observations: Observations, prior: CameraPose, blank: SpeedReference, reference: SpeedReference
) -> Reason | None:
    """A reason that names what is too far off to be a bias; None where nothing is."""
    slow, fast = config.USUAL_SPEEDS_MPS
    speed_mps, stature_m = reference.walking_speed_mps, reference.stature_m
    if not slow <= speed_mps <= fast:
        return Reason(
            code=TracksCode.SPEED_UNUSUAL,
            values={"speed_mps": speed_mps, "slow_mps": slow, "fast_mps": fast},
        )
    short, tall = config.USUAL_STATURES_M
    if stature_m is not None and not short <= stature_m <= tall:
        return Reason(
            code=TracksCode.STATURE_UNUSUAL,
            values={"stature_m": stature_m, "short_m": short, "tall_m": tall},
        )
    inflated = replace(blank, pose_variance_inflation=reference.pose_variance_inflation)
    free = joint_estimate(observations, prior, inflated)
    apart = (free.raw - plane_parameters_of(prior))[:2]
    sigmas = np.abs(apart) / np.sqrt(np.diag(free.covariance))[:2]
    if ((np.abs(apart) > config.DOUBTED_RAD) & (sigmas > config.DOUBTED_SIGMAS)).any():
        tilt, roll = (float(angle) for angle in apart)
        values = {"tilt_rad": tilt, "roll_rad": roll}
        return Reason(code=TracksCode.PRIOR_POSE_DOUBTED, values=values)
    return None
