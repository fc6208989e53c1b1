"""Whether two estimates are of two poses beyond doubt: the second look at a change."""

import numpy as np

from models.estimation.parameters import PLANE_PARAMETERS
from models.flow.fusion import FusedEstimate
from models.geometry.pose_parameters import PARAMETERS
from models.quantiles import f_above

_BY_CHANCE = 1e-4  # of windows that are suspected already
_FEWEST_GROUPS = 7  # more than there are parameters, for a covariance to be known at all


def moved_beyond_doubt(
    before: FusedEstimate, groups_before: int, after: FusedEstimate, groups_after: int
) -> bool:
    """Whether a camera has moved from one estimate to the other.

    A cut must leave a pose behind it: where the tracks after it leave tilt, roll or height open,
    more of them are to be waited for. A heading that is not identifiable counts for as little as is
    known of it. Of few groups a covariance is not well known, and chance goes farther.

    Source: Hotelling 1931, T squared, by the freedom of the smaller part.
    """
    groups = min(groups_before, groups_after)
    if groups < _FEWEST_GROUPS or not set(PLANE_PARAMETERS) <= set(after.identifiable):
        return False
    apart = after.values - before.values
    squared = float(apart @ np.linalg.solve(before.covariance + after.covariance, apart))
    parameters, freedom = len(PARAMETERS), groups - len(PARAMETERS)
    limit = parameters * (groups - 1) / freedom * f_above(_BY_CHANCE, parameters, freedom)
    return squared > limit
