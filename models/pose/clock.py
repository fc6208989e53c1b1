"""A wrong clock: people walk where they did, and all of them faster or slower.

Places tell the pose, and speeds the scale. Where places say that the camera stands, and the speeds
of the same people another height and nothing else, times are too long or too short by that factor.

Ours: p(clock | d) / p(stands | d) = prior odds · t(d; 0, C + Q + P) / t(d; 0, C + Q), with d the
joint estimate less the prior pose, C its covariance, Q what days differ by in pace, and P what a
clock is wrong by.
"""

import math
from dataclasses import dataclass

import numpy as np

from models.geometry.pose import PLANE_PARAMETERS, plane_parameters_of
from models.monitoring.chart import CLOCK
from models.monitoring.config import HABITS_OF_DAYS
from models.monitoring.verdict import reason_of_scale
from models.pose import config
from models.pose.hypotheses import PosePosterior, degrees_of_freedom, log_student
from models.pose.pose_fit import FusedEstimate
from models.reasons import Reason
from models.walking.config import FEWEST_GROUPS
from models.walking.estimate import JointEstimate

_SCALE = np.diag([float(name == "height") for name in PLANE_PARAMETERS])


@dataclass(frozen=True, slots=True, kw_only=True)
class WrongClock:
    """How likely times are wrong while the camera stands, and the factor by which they are."""

    probability: float
    factor: float

    def reason(self, certainty: float, frame_rate_hz: float | None) -> Reason | None:
        """The reason, where it is so certain; None where it is not, or a habit of the hour."""
        if self.probability < certainty:
            return None
        return reason_of_scale(self.factor, frame_rate_hz)


def wrong_clock(
    joint: JointEstimate, fused: FusedEstimate, posterior: PosePosterior, moved_prior: float
) -> WrongClock | None:
    """How likely the clock is wrong; None where places do not say that the camera stands.

    A wrong clock is as seldom as a move of the height alone.
    """
    if not fused.registered or joint.walking_groups < FEWEST_GROUPS:
        return None
    offset = joint.values - plane_parameters_of(posterior.prior)
    offset[1] = math.remainder(float(offset[1]), 2 * math.pi)
    right = joint.covariance + HABITS_OF_DAYS[CLOCK] ** 2 * _SCALE
    scales = np.stack([right, right + config.CLOCK_SD**2 * _SCALE])
    solved = np.linalg.solve(scales, offset[:, None])[..., 0]
    likely = log_student(solved @ offset, scales, degrees_of_freedom(joint.walking_groups))
    odds = config.SCALE_SHARE * moved_prior / (1 - moved_prior)
    log_odds = float(likely[1] - likely[0]) + math.log(max(odds * posterior.weights[0], 1e-300))
    log_factor = config.CLOCK_SD**2 * float((_SCALE @ solved[1]).sum())
    return WrongClock(
        probability=1 / (1 + math.exp(min(-log_odds, 700.0))), factor=math.exp(log_factor)
    )
