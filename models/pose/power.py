"""The power of a site's tracks: the smallest moves that would be told of so many people."""

import math

import numpy as np
from scipy.stats import norm

from models.geometry.pose import PARAMETERS
from models.geometry.rotation import Array
from models.monitoring.config import BORNE_OUT
from models.pose import config
from models.pose.hypotheses import off_sd_at_odds, seen_parameters
from models.pose.pose_fit import FusedEstimate

PEOPLE = np.array([60, 250, 800])
_SHORT = float(norm.ppf(0.9))  # sd that nine of ten estimates fall short of a move by at the most
_MOST_SD = 60.0


def smallest_told(
    fused: FusedEstimate,
    walking_groups: int,
    people: int,
    reference_people: float,
    moved_prior: float = config.MOVED_PRIOR,
) -> Array:
    """The smallest moves (4, 3) in each parameter alone that nine of ten windows would tell.

    Of 60, 250 and 800 people, by `hypotheses`: radians, and the log of the height; nan where the
    tracks say nothing. An estimate's variance falls with its people, but for what it has of the
    reference's.

    `people` walk in the window, `reference_people` made the site's map.
    """
    found = np.full((len(PARAMETERS), PEOPLE.size), np.nan)
    seen = seen_parameters(fused, walking_groups)
    if not seen.any() or not people:
        return found
    shrunk = (1 / PEOPLE + 1 / reference_people) / (1 / people + 1 / reference_people)
    groups = PEOPLE * walking_groups / people
    precision = np.diag(np.linalg.inv(fused.covariance[np.ix_(seen, seen)]))
    variances = shrunk / precision[:, None]
    log_odds = math.log(BORNE_OUT / (1 - BORNE_OUT))
    off_sd = off_sd_at_odds(log_odds, variances, seen, groups, moved_prior)
    found[seen] = np.where(off_sd < _MOST_SD, (off_sd + _SHORT) * np.sqrt(variances), np.nan)
    return found
