"""The slope of what is estimated against what is true: 1 where an estimate does not shrink."""

import numpy as np

from models.geometry.rotation import Array

_FEWEST = 3


def slope_with_error(true: Array, found: Array) -> tuple[float | None, float | None]:
    """Least squares' slope (N,) against (N,), with an intercept, and its standard error.

    None where there are fewer than 3, or the true ones are all the same.
    """
    if len(true) < _FEWEST or not np.ptp(true) > 1e-9:
        return None, None
    centred = true - true.mean()
    power = float(centred @ centred)
    slope = float(centred @ found) / power
    residual = found - found.mean() - slope * centred
    return slope, float(np.sqrt(residual @ residual / max(len(true) - 2, 1) / power))
