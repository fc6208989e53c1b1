"""What of a reference cannot be true: speeds, statures, or a pose too far from the prior."""

from dataclasses import replace

import numpy as np

from models.geometry.plane_parameters import plane_parameters_of
from models.geometry.pose import CameraPose
from models.reasons import Reason, TracksCode
from models.tracks.observations import Observations
from models.walking.estimate import joint_estimate
from models.walking.speed_reference import (
    USUAL_SPEEDS_MPS,
    USUAL_STATURES_M,
    SpeedReference,
)

_DOUBT_RAD = float(np.radians(4.0))
_DOUBT_SIGMAS = 4.0


def doubt_of(
    observations: Observations, prior: CameraPose, blank: SpeedReference, site: SpeedReference
) -> Reason | None:
    """What of a reference is too far off to be a bias; None where nothing is."""
    slow, fast = USUAL_SPEEDS_MPS
    if not slow <= site.walking_speed_mps <= fast:
        return Reason(
            code=TracksCode.SPEED_UNUSUAL,
            values={"speed_mps": site.walking_speed_mps, "slow_mps": slow, "fast_mps": fast},
        )
    short, tall = USUAL_STATURES_M
    if site.stature_m is not None and not short <= site.stature_m <= tall:
        return Reason(
            code=TracksCode.STATURE_UNUSUAL,
            values={"stature_m": site.stature_m, "short_m": short, "tall_m": tall},
        )
    inflated = replace(blank, pose_variance_inflation=site.pose_variance_inflation)
    free = joint_estimate(observations, prior, inflated)
    apart = (free.raw - plane_parameters_of(prior))[:2]
    sigmas = np.abs(apart) / np.sqrt(np.diag(free.covariance))[:2]
    if ((np.abs(apart) > _DOUBT_RAD) & (sigmas > _DOUBT_SIGMAS)).any():
        tilt, roll = (float(angle) for angle in apart)
        values = {"tilt_rad": tilt, "roll_rad": roll}
        return Reason(code=TracksCode.PRIOR_POSE_DOUBTED, values=values)
    return None
