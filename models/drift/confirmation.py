"""Whether two estimates are of two poses beyond doubt: the second look at a change."""

import numpy as np

from models.estimation.numbers import NUMBERS, WITH_HEADING
from models.flow.fusion import FusedEstimate
from models.quantiles import f_above

_BY_CHANCE = 1e-4  # of windows that are suspected already
_FEWEST_PARTIES = 7  # more than there are numbers, for a covariance to be known at all


def moved_beyond_doubt(
    before: FusedEstimate, parties_before: int, after: FusedEstimate, parties_after: int
) -> bool:
    """Whether a camera has moved from one estimate to the other.

    A cut must leave a pose behind it: where the tracks after it cannot tell tilt, roll or height,
    more of them are to be waited for. A heading that is not told counts for as little as is known
    of it. Of few parties a covariance is not well known, and chance goes farther.

    Source: Hotelling 1931, T squared, by the freedom of the smaller part.
    """
    parties = min(parties_before, parties_after)
    if parties < _FEWEST_PARTIES or not set(NUMBERS) <= set(after.told):
        return False
    apart = after.values - before.values
    squared = float(apart @ np.linalg.solve(before.covariance + after.covariance, apart))
    numbers, freedom = len(WITH_HEADING), parties - len(WITH_HEADING)
    limit = numbers * (parties - 1) / freedom * f_above(_BY_CHANCE, numbers, freedom)
    return squared > limit
