"""Log densities as they are stored: small whole numbers, the same offline as in the service.

Ours: level = round(64 log f).
"""

import numpy as np
import numpy.typing as npt

from models.geometry.rotation import Array

_PARTS = 64  # of one unit of a log density: rounding changes it by less than 0.008


def to_levels(log_density: Array) -> npt.NDArray[np.int16]:
    """Log densities between -500 and 500 as whole numbers, of the same shape."""
    return np.rint(log_density * _PARTS).astype(np.int16)


def of_levels(levels: npt.NDArray[np.int16]) -> Array:
    """The log densities of `to_levels`, rounded."""
    return levels.astype(np.float64) / _PARTS


def rounded(log_density: Array) -> Array:
    """Log densities as they come back from the store."""
    return of_levels(to_levels(log_density))
