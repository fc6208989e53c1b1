"""Whether two estimates are of two poses beyond doubt: the second look at a change."""

import numpy as np

from models.estimation.joint.estimate import JointEstimate
from models.estimation.parameters import PLANE_PARAMETERS
from models.quantiles import chi_squared_above

# Twice what a chi-squared passes once in a million: the same people are in many of a crowd's last
# tracks, and crowds change. On recorded scenes of still cameras, cuts that were none reached 41.
_BY_CHANCE = 1e-6
_DOUBT = 2.0


def moved_beyond_doubt(before: JointEstimate, after: JointEstimate) -> bool:
    """Whether a camera has moved from one estimate to the other.

    A cut must leave a pose behind it: where a parameter of the tracks after it is not identifiable,
    more of them are to be waited for. The covariances know of walking groups and of other poses
    that explain the tracks about as well, where a change point's own do not.
    """
    if len(after.identifiable) < len(PLANE_PARAMETERS):
        return False
    apart = after.values - before.values
    squared = float(apart @ np.linalg.solve(before.covariance + after.covariance, apart))
    return squared > _DOUBT * chi_squared_above(_BY_CHANCE, 3)
