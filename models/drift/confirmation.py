"""Whether two estimates are of two poses beyond doubt: the second look at a change."""

import numpy as np

from models.estimation.joint.estimate import JointEstimate

# Twice what a chi-squared of 3 degrees of freedom passes once in a million: the same people are
# in many of a crowd's last tracks, and crowds change. On recorded scenes of still cameras, cuts
# that were none reached 41.
_LIMIT = 2 * 30.7


def moved_beyond_doubt(before: JointEstimate, after: JointEstimate) -> bool:
    """Whether a camera has moved from one estimate to the other.

    A cut must leave a pose behind it: where the tracks after it cannot tell a number, more of them
    are to be waited for. The covariances know of parties and of other poses that explain the
    tracks about as well, where a change point's own do not.
    """
    if after.weak:
        return False
    apart = after.values - before.values
    squared = float(apart @ np.linalg.solve(before.covariance + after.covariance, apart))
    return squared > _LIMIT
