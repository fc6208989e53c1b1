"""Whether two estimates are of two poses beyond doubt: the second look at a change."""

import numpy as np

from models.geometry.plane_parameters import PLANE_PARAMETERS
from models.geometry.pose_parameters import PARAMETERS
from models.monitoring.config import HABITS_OF_DAYS
from models.pose.fusion import FusedEstimate
from models.quantiles import chi_squared_above, f_above

_BY_CHANCE = 1e-4  # of windows that are suspected already
_BY_HABIT = 1e-5
# What people of one hour do otherwise than those of another (variances by the four parameters): a
# pace that is 3 % off is a height that is 3 % off.
_HABITS = (
    np.append(
        HABITS_OF_DAYS[:2], [np.hypot(HABITS_OF_DAYS[2], HABITS_OF_DAYS[4]), HABITS_OF_DAYS[3]]
    )
    ** 2
)
_FEWEST_GROUPS = 7  # more than there are parameters, for a covariance to be known at all


def moved_beyond_doubt(
    before: FusedEstimate, groups_before: int, after: FusedEstimate, groups_after: int
) -> bool:
    """Whether a camera has moved from one estimate to the other.

    Neither chance may have made them so different nor, whoever walked, people's habits. Of few
    groups a covariance is not well known, and chance goes farther. A heading that is not
    identifiable counts for as little as is known of it. There must have been a pose to move from,
    and what has moved the farthest by its standard deviation must be identifiable where it is now:
    the rest may be left open by the few who came since, as the prior's, and is better so than told
    by those of before.

    Source: Hotelling 1931, T squared, by the freedom of the smaller part; with habits, whose
    variance is given, a chi square.
    """
    groups = min(groups_before, groups_after)
    if groups < _FEWEST_GROUPS or not set(PLANE_PARAMETERS) <= set(before.identifiable):
        return False
    apart = after.values - before.values
    chance = before.covariance + after.covariance
    habits = chance + 2 * np.diag(_HABITS)
    farthest = PARAMETERS[int(np.argmax(apart**2 / np.diag(habits)))]
    if farthest not in set(before.identifiable) & set(after.identifiable):
        return False
    parameters, freedom = len(PARAMETERS), groups - len(PARAMETERS)
    limit = parameters * (groups - 1) / freedom * f_above(_BY_CHANCE, parameters, freedom)
    beyond_chance = float(apart @ np.linalg.solve(chance, apart)) > limit
    beyond_habit = float(apart @ np.linalg.solve(habits, apart)) > chi_squared_above(
        _BY_HABIT, parameters
    )
    return beyond_chance and beyond_habit
